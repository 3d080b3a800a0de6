"""The figures: whatever comes in, a Figure comes out whose axes say what they show and in which unit."""

from __future__ import annotations

import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from numpy.testing import assert_allclose

from orthoscope.evaluation.misfit.misfit import misfit
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.cells import Cells, cells_for
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import LENSES, Brown, KannalaBrandt
from orthoscope.report import plates
from orthoscope.report.data.lens_curve import along_angles
from orthoscope.report.figures import (
    lens_difference,
    lens_misfit,
    residual_vectors,
    residuals_by_place,
    residuals_by_view,
    target_misfit,
    target_shape,
    to_svg,
)
from orthoscope.report.figures.lens import distortion_curve
from orthoscope.report.figures.style import RED, named
from orthoscope.report.plates import PLATES
from orthoscope.report.print_files import check_matplotlib, write_figures
from orthoscope.targets.detections import Detections

KINDS = (
    "ordinary",
    "fisheye",
    "unheld",
    "misshapen",
    "shaped",
)  # pages of all of them are drawn in test_page.py
UNITS = ("(px)", "(mm)", "(px per point)", "(m)", "(°)", "(name)", "(number in the table below)")

for_every_plate = pytest.mark.parametrize("plate", PLATES, ids=lambda plate: plate.name)


@for_every_plate
@pytest.mark.parametrize("kind", KINDS)
def test_every_figure_of_every_evaluation_has_labelled_axes_with_units(plate, kind, every_evaluation):
    if not plate.suits(every_evaluation[kind]):
        return
    figure = plate.draw(every_evaluation[kind])
    assert isinstance(figure, Figure)
    for axes in figure.axes:
        last = axes.get_subplotspec() is None or axes.get_subplotspec().is_last_row()
        bar = axes.get_label() == "<colorbar>"
        labels = [axes.get_ylabel()] + ([axes.get_xlabel()] if last and not bar else [])
        labels += [axes.get_zlabel()] if axes.name == "3d" else []
        assert all(label.endswith(UNITS) for label in labels), labels


@for_every_plate
def test_a_calibration_without_corners_still_has_its_figures(plate, ordinary):
    empty = Detections(ordinary.calibration.detections.target, (640, 480), ())
    calibration = replace(ordinary.calibration, detections=empty, camera_from_target=())
    nothing = replace(
        ordinary,
        calibration=calibration,
        views=(),
        held_out_residuals=(),
        suspects=(),
        misfit=misfit(calibration),
    )
    if plate.suits(nothing):
        to_svg(plate.draw(nothing), plate.name)


@for_every_plate
def test_every_figure_suits_some_evaluation(plate, every_evaluation):
    assert any(plate.suits(evaluation) for evaluation in every_evaluation.values())


def test_a_residual_arrow_starts_at_the_detected_corner_and_ends_at_the_predicted_one(ordinary):
    calibration = ordinary.calibration
    arrows = residual_vectors(calibration).axes[0].collections[0]
    detected = np.concatenate([view.pixels for view in calibration.detections.views])
    residuals = np.concatenate(calibration.residuals())
    order = np.argsort(np.hypot(*residuals.T), kind="stable")
    assert_allclose(arrows.get_offsets(), detected[order])
    assert_allclose(np.stack([arrows.U, arrows.V], axis=-1), residuals[order])
    assert (arrows.angles, arrows.scale_units) == ("xy", "xy")


def test_misfits_of_noise_say_that_there_is_only_noise(ordinary):
    tests = (ordinary.misfit.target.test, ordinary.misfit.lens.test)
    for figure, test in zip((target_misfit(ordinary), lens_misfit(ordinary)), tests, strict=True):
        texts = [text.get_text() for text in figure.axes[0].texts]
        assert test.systematic_px < 0.1 * test.noise_px
        assert test.systematic_px > 0.0 or "the views agree on nothing: only noise" in texts


def test_misfits_of_one_view_say_that_it_is_too_few(single):
    for figure in (target_misfit(single), lens_misfit(single)):
        assert "too few views to tell" in [text.get_text() for text in figure.axes[0].texts]


def test_a_displaced_corner_is_an_arrow_from_its_place_in_millimetres(shaped):
    shape = target_shape(shaped.calibration)
    arrows = next(drawn for drawn in shape.axes[0].collections if isinstance(drawn, Quiver))
    points, moved = shaped.calibration.detections.target.points, shaped.calibration.target_shape.displacements
    assert_allclose(arrows.get_offsets(), 1e3 * points[:, :2])
    assert_allclose(np.stack([arrows.U, arrows.V], axis=-1), 1e3 * moved[:, :2])
    assert shape.axes[1].get_ylabel() == "out of the plane, away from the camera (mm)"


def test_the_misfit_of_a_bent_board_is_drawn_with_its_scale_in_pixels(misshapen):
    texts = [text.get_text() for text in target_misfit(misshapen).axes[0].texts]
    assert any(
        re.search(r"mm   \(in the plane, magnified \d+ times; 1 mm is \d\.\d px\)", text) for text in texts
    )


def test_the_difference_between_a_lens_and_itself_is_nothing_and_another_is_mapped(ordinary, fisheye):
    camera = ordinary.calibration.camera
    other = replace(camera, lens=Brown(k1=-0.2))
    assert (
        lens_difference(camera, camera).axes[1].get_ylabel()
        == lens_difference(camera, other).axes[1].get_ylabel()
    )
    largest = [
        float(lens_difference(camera, one).axes[0].collections[0].get_array().max())
        for one in (camera, other)
    ]
    assert largest[0] < 1e-6 < 1.0 < largest[1]
    to_svg(
        lens_difference(
            fisheye.calibration.camera, replace(fisheye.calibration.camera, lens=KannalaBrandt())
        ),
        "difference",
    )


def test_residuals_by_place_are_the_held_out_ones_where_there_are_any(ordinary, unheld):
    assert residuals_by_place(ordinary).axes[1].get_ylabel().startswith("held-out")
    assert residuals_by_place(unheld).axes[1].get_ylabel().startswith("training")


def test_a_suspect_is_named_and_coloured_among_few_views_and_among_many(suspicious):
    few = residuals_by_view(suspicious).axes[0]
    assert [
        label.get_text() for label in few.get_xticklabels() if to_hex(label.get_color()) == RED.lower()
    ] == ["left04.jpg"]
    many = tuple(replace(view, image=f"{i}-{view.image}") for i in range(8) for view in suspicious.views)
    axes = residuals_by_view(replace(suspicious, views=many, suspects=(("5-left04.jpg", "odd"),))).axes[0]
    assert [text.get_text() for text in axes.texts] == ["5-left04.jpg"]


@pytest.mark.parametrize("name", LENSES)
def test_the_distortion_curve_of_every_lens_can_be_drawn(name, ordinary):
    camera = Camera((640, 480), Intrinsics(500.0, 500.0, 320.0, 240.0), LENSES[name]())
    curve = distortion_curve(replace(ordinary.calibration, camera=camera)).axes[1].lines[0]
    assert np.isfinite(curve.get_xydata()).all()


def test_radial_displacement_is_the_formulas_own():
    camera = Camera((640, 480), Intrinsics(500.0, 500.0, 320.0, 240.0), Brown(k1=-0.2))
    angles = np.linspace(0.0, 0.6, 7)
    radius, displacement = along_angles(camera, angles)
    s = np.tan(angles)[:, None]
    assert_allclose(
        radius, np.broadcast_to(500.0 * (s - 0.2 * s**3), radius.shape), atol=1e-9
    )  # px; rounding of 500 px
    assert_allclose(displacement, np.broadcast_to(-100.0 * s**3, displacement.shape), atol=1e-9)


def test_displacement_of_a_lens_of_the_angle_is_taken_from_the_equidistant_image_past_90_degrees():
    camera = Camera((640, 480), Intrinsics(150.0, 150.0, 320.0, 240.0), KannalaBrandt(k1=-0.01))
    angles = np.array([0.0, 1.0, 1.7])
    _, displacement = along_angles(camera, angles)
    assert_allclose(displacement[:, 0], -1.5 * angles**3, atol=1e-9)


def test_cells_count_every_pixel_once_also_on_the_edges():
    cells = Cells((640, 480), 8, 6)
    edge = np.array([[-0.5, -0.5], [639.5, 479.5], [79.5, 0.0], [79.499, 0.0]])
    assert cells.of(edge).tolist() == [0, 47, 1, 0]
    assert cells.count(edge).sum() == 4


def test_cell_means_are_nan_where_nothing_fell():
    cells = Cells((4, 2), 2, 1)
    assert_allclose(cells.mean(np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([1.0, 3.0])), [[2.0, np.nan]])


@pytest.mark.parametrize("size", [(640, 480), (480, 640), (4000, 30), (1, 1)])
def test_cells_are_nearly_square_and_about_as_many_as_wanted(size):
    cells = cells_for(size, 100)
    assert 1 <= cells.columns * cells.rows <= 120


def test_a_name_is_no_formula_and_has_nothing_unseen():
    figure = Figure()
    axes = figure.add_subplot()
    axes.set_title(named("$\\frac{a}$\x1b\n.png"))
    assert r"$\frac{a}$\x1b\n.png" in to_svg(figure, "f")


@pytest.mark.slow
def test_figures_for_a_paper_are_written_as_svg_and_pdf_the_same_every_time(ordinary, tmp_path, monkeypatch):
    monkeypatch.setattr(plates, "PLATES", plates.PLATES[:1])
    for folder in ("a", "b"):
        written = write_figures(ordinary, tmp_path / folder)
        assert [path.name for path in written] == ["by-view.svg", "by-view.pdf"]
    assert (tmp_path / "a/by-view.svg").read_text().startswith("<svg")
    assert (tmp_path / "a/by-view.pdf").read_bytes().startswith(b"%PDF")
    for name in ("by-view.svg", "by-view.pdf"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_without_matplotlib_one_is_told_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"pip install 'orthoscope\[figures\]'"):
        check_matplotlib()
