"""The whole of section 4, quickly: one page, CSV files, the same bytes whoever does the work."""

from __future__ import annotations

import csv
import io
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from orthoscope.cli.paper import paper as paper_command
from orthoscope.files.images import write_image
from orthoscope.geometry.arrays import CalibrationError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.paper.documents import documents
from orthoscope.paper.entries import MLDC, OURS, PAPER, TOLD_SETTINGS
from orthoscope.paper.photographs import SPLIT_COUNT, obliqueness, split
from orthoscope.paper.section4 import Plan, run
from orthoscope.simulation.render import rendered_photographs
from orthoscope.simulation.scene import Scene, random_views, simulate_detections
from orthoscope.targets.target import chessboard

LEAST = Plan.quick(trials=1, board=(4, 5), noise_px=(0.1, 0.5), points=((3, 4), (4, 5)), images=(4,), grids=1)
CURVES = [
    "method",
    "training_nce",
    "test_nce",
    "test_nce_standard_error",
    "noisy_test_nce",
    "true_pose_nce",
    "trials",
    "failures",
]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Eight views of a small board."""
    camera = Camera((320, 240), Intrinsics(260.0, 259.0, 162.0, 118.0), Brown(k1=-0.25, k2=0.08, p1=0.001))
    board = chessboard(6, 5, 0.03)
    return Scene(
        camera,
        board,
        random_views(camera, board, 8, rng=np.random.default_rng(3), fill=(0.5, 0.9), margin=0.03),
    )


@pytest.fixture(scope="module")
def detections(scene):
    return simulate_detections(scene, noise_px=0.1, rng=np.random.default_rng(4))


@pytest.fixture(scope="module")
def made(scene, detections, tmp_path_factory):
    """The documents of a run with photographs. Our own method is told the lens too, and takes a tenth of the
    time.
    """
    told = {"shape": "flat", "base": "brown", "first_lens": "formula"}
    folder = tmp_path_factory.mktemp("photos")
    files = {}
    for name, image in rendered_photographs(scene, rng=np.random.default_rng(5)):
        files[name] = folder / f"{name}.png"
        write_image(files[name], image)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(TOLD_SETTINGS, "decoupled", told)
        return documents(run(LEAST, detections=detections), files)


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.slow
def test_every_figure_and_table_has_its_file(made):
    figures = {
        "fig2",
        "fig3",
        "fig4",
        "fig5",
        "images_low",
        "images_high",
        "fig6",
        "lenses_low",
        "lenses_high",
    }
    assert set(made.texts) == {
        "paper.html",
        "trials.csv",
        "trials_photographs.csv",
        "methods.csv",
        "eq7.csv",
        "table1.csv",
        "fig1.csv",
    } | {f"{name}.csv" for name in figures}


@pytest.mark.slow
def test_files_have_their_columns_and_a_row_for_each_method_and_level(made):
    rows = rows_of(made.texts["fig2.csv"])
    assert list(rows[0]) == ["noise_px", *CURVES]
    assert {row["method"] for row in rows} >= {entry.name for entry in (*PAPER, *OURS)}
    assert {float(row["noise_px"]) for row in rows} == set(LEAST.noise_px)
    assert next(iter(rows_of(made.texts["fig4.csv"])[0])) == "points"
    assert {row["points"] for row in rows_of(made.texts["fig4.csv"])} == {"12", "20"}
    assert next(iter(rows_of(made.texts["images_low.csv"])[0])) == "images"
    assert list(rows_of(made.texts["table1.csv"])[0])[:3] == ["method", "fx", "fx_std"]
    assert {row["study"] for row in rows_of(made.texts["trials.csv"])} == {
        "noise",
        "points",
        "images",
        "exact",
        "lenses",
        "step2",
    }
    assert {row["study"] for row in rows_of(made.texts["trials_photographs.csv"])} == {"photographs"}


@pytest.mark.slow
def test_figures_are_the_means_of_the_trials(made):
    trials = [
        row
        for row in rows_of(made.texts["trials.csv"])
        if (row["study"], row["scene"], row["method"]) == ("noise", "low", MLDC)
    ]
    shown = [row for row in rows_of(made.texts["fig2.csv"]) if row["method"] == MLDC]
    assert [row["test_nce"] for row in shown] == [
        row["test_nce"] for row in trials
    ]  # one trial is its own mean


@pytest.mark.slow
def test_eq_7_ends_at_zero_and_at_different_cameras(made):
    ends = [row for row in rows_of(made.texts["eq7.csv"]) if row["scene"] == "low" and row["J"]]
    assert all(float(row["J"]) < 1e-10 for row in ends)
    assert len({row["fx"] for row in ends}) >= len(LEAST.dampings)


@pytest.mark.slow
def test_the_page_needs_nothing_else_and_shows_every_figure(made):
    page = made.texts["paper.html"]
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    assert "<script" not in page
    assert "default-src 'none'" in page
    for word in (
        "Fig. 1",
        "Fig. 2",
        "Fig. 3",
        "Fig. 4",
        "Fig. 5",
        "Fig. 6",
        "Fig. 7",
        "Table 1",
        "Axis 211 W",
        "stand in for it",
    ):
        assert word in page
    assert page.count('width="237.6pt"') == 14  # training and test of seven figures
    assert page.count('src="data:image/jpeg') >= 6
    assert "plumb line, edges alone" in page
    assert page.count('<image href="data:image/jpeg') == 1
    assert " style=" not in page  # the page's policy would let none of them act
    assert made.headline.replace("'", "&#39;") in page


def test_every_photograph_is_a_test_once(detections):
    tested = [view.image for turn in range(SPLIT_COUNT) for view in split(detections, turn)[1].views]
    assert sorted(tested) == sorted(view.image for view in detections.views)
    training, test = split(detections, 0)
    assert not {view.image for view in training.views} & {view.image for view in test.views}


def test_too_few_photographs_are_refused_before_anything_is_run(detections):
    with pytest.raises(CalibrationError, match="found in 3 photographs"):
        run(LEAST, detections=detections.only(range(3)))


def test_gamma_is_the_angle_between_the_pixel_axes():
    oblique = obliqueness(np.array([500.0, 500.0, 500.0]), np.array([0.0, 500.0, -500.0]))
    np.testing.assert_allclose(oblique, [90.0, 135.0, 45.0])


def paper(*arguments: object) -> subprocess.CompletedProcess[str]:
    """`orthoscope paper ARGUMENTS` in a process of its own, where no types are checked and it takes a third
    of the time.
    """
    code = "from orthoscope.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, "paper", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


SOME = ("--only", "fig4", "--points", "3x4,4x5")


@pytest.mark.slow
@pytest.mark.parametrize("some", [SOME, ()], ids=["some", "all"])
def test_one_process_and_two_give_the_same_bytes_and_say_how_to_get_the_rest(tmp_path, some):
    for jobs in (1, 2):
        told = paper("--quick", "--trials", 1, *some, "--jobs", jobs, "-o", tmp_path / str(jobs))
        assert told.returncode == 0, told.stderr
        assert "main claim" in told.stdout
    assert contents(tmp_path / "1") == contents(tmp_path / "2")
    assert b"--photos photos/ --target" in contents(tmp_path / "1")["paper.html"]
    assert not {"fig6.csv", "table1.csv"} & set(contents(tmp_path / "1"))


def test_photographs_that_are_not_there_are_a_wrong_command(tmp_path):
    told = paper("--photos", tmp_path / "none", "--target", "chessboard:9x6:25mm", "-o", tmp_path / "out")
    assert told.returncode == 2
    assert "none" in told.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (("--tilt", "50", "10"), "50 is more than 10"),
        (("--fill", "0.9", "0.5"), "0.9 is more than 0.5"),
        (("--fill", "0.5", "1"), "0.98"),
        (("--noise", "0.1,,0.2"), "such as 0,0.1,1"),
        (("--points", "3x"), "such as 3x4,14x20"),
    ],
)
def test_a_range_or_a_list_that_is_none_is_refused_in_the_units_it_was_given_in(told, expected):
    refused = CliRunner().invoke(paper_command, [*told, "--only", "fig4"])
    assert refused.exit_code == 2
    assert expected in refused.output
