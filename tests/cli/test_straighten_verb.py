"""`orthoscope straighten`: photographs without a target to straight pictures."""

from __future__ import annotations

import json

import numpy as np
import pytest
from benchmarks.studies.streets import street_camera, street_photograph

from orthoscope.files.images import write_image
from orthoscope.formats.load import load_camera
from orthoscope.models.lenses.table import Brown


@pytest.mark.slow
def test_it_writes_straight_pictures_their_camera_and_the_lens(run, tmp_path):
    truth, rng = street_camera(Brown(k1=-0.28, k2=0.08)), np.random.default_rng(0)
    for name in ("a", "b"):
        write_image(tmp_path / f"{name}.png", street_photograph(truth, rng=rng))
    told = run("straighten", tmp_path, "-o", tmp_path / "out")
    assert told.code == 0, told.err
    assert told.out.splitlines()[0].startswith("lens ")
    assert {path.name for path in (tmp_path / "out").glob("*.*")} >= {
        "a.png",
        "b.png",
        "camera.json",
        "lens.json",
    }
    lens = load_camera(tmp_path / "out/lens.json")
    assert np.hypot(lens.intrinsics.cx - 330, lens.intrinsics.cy - 232) < 10
    as_json = run("straighten", tmp_path / "a.png", "--lens", "division", "--json", "-o", tmp_path / "out")
    assert json.loads(as_json.out)["lens"]["name"] == "division"


def test_what_shows_no_edges_is_an_answer_and_not_a_crash(run, tmp_path):
    write_image(tmp_path / "grey.png", np.full((120, 160), 90, np.uint8))
    told = run("straighten", tmp_path / "grey.png", "-o", tmp_path / "out")
    assert told.code == 1
    assert "edges" in told.err
