"""The lens by straight edges, without a target: on streets whose camera is known, and what is refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from benchmarks.studies.plumb_line import STREET_LENSES, apart, street_edges
from benchmarks.studies.streets import street_camera
from numpy.testing import assert_allclose

from helpers.real_sets import classic
from orthoscope.files.images import read_image, write_image
from orthoscope.geometry.arrays import CalibrationError, InputError
from orthoscope.methods.fccm import fccm
from orthoscope.methods.plumb_line.division import division_of_edges
from orthoscope.methods.plumb_line.edges import Edge, edges_of
from orthoscope.methods.plumb_line.photographs import lens_of_photographs
from orthoscope.methods.plumb_line.plumb_line import lens_of_edges
from orthoscope.models.lenses.table import Brown, Division

SIZE = (640, 480)
BARREL = Brown(k1=-0.28, k2=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("name", STREET_LENSES)
def test_three_streets_tell_the_lens_within_a_pixel_over_the_frame(name):
    lens, focal = STREET_LENSES[name]
    truth = street_camera(lens, focal=focal)
    found = lens_of_edges(street_edges(truth, seed=1), SIZE)
    assert apart(found.camera, truth).max() < 1.0
    assert 0.05 < found.rms_px < 0.12  # the noise of an edge, not of what is bent in space


@pytest.mark.slow
def test_what_is_bent_in_space_is_left_out():
    """Nine facades' edges in ten are taken, of cables and crowns next to none."""
    truth = street_camera(BARREL)
    found = lens_of_edges(street_edges(truth, 0, 2), SIZE)
    straight = [truth.undistort_pixels(edge.pixels) for edge in found.edges]
    bent = np.array(
        [np.linalg.svd(p - p.mean(0), full_matrices=False)[1][1] / len(p) ** 0.5 for p in straight]
    )
    assert found.used[bent < 0.12].mean() > 0.9
    assert found.used[bent > 1.0].mean() < 0.05


def test_an_edge_is_found_where_it_is_to_a_twentieth_of_a_pixel():
    x, y = np.meshgrid(np.arange(200.0), np.arange(150.0))
    across = (x - 80.3) * np.cos(0.2) + (y - 70.0) * np.sin(0.2)
    image = np.clip(120 + 60 * np.tanh(across / 1.2), 0, 255).round().astype(np.uint8)
    edge = edges_of(image)[0]
    off = (edge.pixels[:, 0] - 80.3) * np.cos(0.2) + (edge.pixels[:, 1] - 70.0) * np.sin(0.2)
    assert edge.length > 120
    assert np.abs(off).max() < 0.05


def test_the_division_model_is_linear_in_an_edge():
    """Circles that are images of straight lines give its coefficient back, exactly."""
    truth = street_camera(Division(l=-0.4), centre=(319.5, 239.5))
    edges = [
        Edge(0, truth.distort_pixels(np.linspace(one, other, 24)))
        for one, other in (((60.0, 50.0), (560.0, 90.0)), ((40.0, 400.0), (100.0, 60.0)))
    ]
    unit = 0.5 * np.hypot(*SIZE)
    assert_allclose(division_of_edges(edges, SIZE), -0.4 * (unit / 520.0) ** 2, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.datasets
def test_the_edges_of_a_board_alone_give_the_image_of_the_full_calibration(datasets):
    """Within half a pixel wherever corners were seen; the calibration has the corners, this one no target."""
    seen = classic(datasets, "opencv-left")
    edges = []
    for number, view in enumerate(seen.views):
        image = read_image(datasets / "opencv-left" / view.image, grey=True)
        board = cv2.convexHull(view.pixels.astype(np.float32))
        for edge in edges_of(image, number):
            inside = [
                cv2.pointPolygonTest(board, tuple(map(float, p)), measureDist=True) for p in edge.pixels
            ]
            edges += [edge] if min(inside) > -25 else []
    found = lens_of_edges(edges, seen.image_size)
    corners = np.concatenate([view.pixels for view in seen.views])
    off = apart(found.camera, fccm(seen, lens="brown").camera, corners)
    assert off.max() < 0.5
    assert np.sqrt((off**2).mean()) < 0.15


def test_too_few_edges_are_refused_and_so_is_a_lens_that_is_none():
    with pytest.raises(CalibrationError, match="edges long enough"):
        lens_of_edges(edges_of(np.full((480, 640), 128, np.uint8)), SIZE)
    with pytest.raises(InputError):
        lens_of_edges(street_edges(street_camera(BARREL), 0, 1), SIZE, lens="nolens")


def test_photographs_of_two_sizes_have_no_one_lens(tmp_path):
    write_image(tmp_path / "a.png", np.zeros((48, 64), np.uint8))
    write_image(tmp_path / "b.png", np.zeros((48, 60), np.uint8))
    with pytest.raises(InputError, match=r"b\.png is 60x48"):
        lens_of_photographs([tmp_path / "a.png", tmp_path / "b.png"])
