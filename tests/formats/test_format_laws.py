"""What must be true of every tool's file: written and read it is the same camera, known by its content, and
nothing that it cannot hold is written as if it could.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from helpers.cameras import SIZE, camera_held, farthest_apart, poses
from orthoscope.formats.export import export
from orthoscope.formats.load import format_of, load_camera, load_contents
from orthoscope.formats.record import Contents
from orthoscope.formats.syntax import Document
from orthoscope.formats.table import FORMATS
from orthoscope.geometry.arrays import InputError
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import FREE, Brown, KannalaBrandt

for_every_tool = pytest.mark.parametrize("tool", FORMATS)
HELD = [
    pytest.param(name, i, suffix, id=f"{name} {holding.word}({len(holding.coefficients)}){suffix}")
    for name, record in FORMATS.items()
    for i, holding in enumerate(record.holdings)
    for suffix in record.suffixes[: None if i == 0 else 1]
    if holding.lens != FREE and holding.written
]


def size_for(tool: str) -> dict:
    """image_size for a tool whose file does not say it."""
    return {} if FORMATS[tool].knows_size else {"image_size": SIZE}


@pytest.mark.parametrize(("tool", "i", "suffix"), HELD)
def test_a_camera_that_a_tool_can_hold_is_written_and_read_as_itself(tmp_path, tool, i, suffix):
    holding = FORMATS[tool].holdings[i]
    camera = camera_held(FORMATS[tool], holding)
    exported = export(camera, tmp_path / f"cameras{suffix}", tool)
    assert exported.held.camera is camera
    assert len(exported.remarks()) == bool(holding.note)  # nothing is lost, at most something to know
    again = load_camera(tmp_path / f"cameras{suffix}", **size_for(tool))
    assert again.image_size == SIZE
    assert farthest_apart(camera, again) < 1e-9  # px: a shift of the origin rounds, and lensfun's units do


@for_every_tool
def test_a_file_is_known_by_its_content(tmp_path, tool):
    record = FORMATS[tool]
    for suffix in record.suffixes:
        export(camera_held(record, record.holdings[0]), tmp_path / f"cameras{suffix}", tool)
        (tmp_path / "nameless").write_bytes((tmp_path / f"cameras{suffix}").read_bytes())
        assert format_of(Document(tmp_path / "nameless")) is record


@for_every_tool
def test_poses_go_along_where_the_record_says_so(tmp_path, tool):
    record = FORMATS[tool]
    for suffix in record.suffixes:
        source = Contents(camera_held(record, record.holdings[0]), poses())
        export(source, tmp_path / f"cameras{suffix}", tool)
        again = load_contents(tmp_path / f"cameras{suffix}", **size_for(tool)).poses
        assert set(again) == (set(poses()) if record.poses else set())
        for image, pose in again.items():
            assert_allclose(pose.rotation, poses()[image].rotation, atol=1e-14)
            assert_allclose(pose.translation, poses()[image].translation, atol=1e-14)


@pytest.mark.parametrize("tool", [name for name, record in FORMATS.items() if len(record.suffixes) > 1])
def test_a_suffix_that_the_tool_does_not_have_is_refused(tmp_path, tool):
    with pytest.raises(InputError, match=r"camera\.txt_ does not say which file"):
        export(camera_held(FORMATS[tool], FORMATS[tool].holdings[0]), tmp_path / "camera.txt_", tool)
    assert not list(tmp_path.iterdir())


@for_every_tool
def test_the_first_pixel_stands_where_the_record_says(tmp_path, tool):
    """A camera whose principal point is the first pixel's centre shows the tool's name for it."""
    record = FORMATS[tool]
    camera = Camera(SIZE, Intrinsics(400.0, 400.0, 0.0, 0.0), Brown())
    seen = []

    def remember(contents, place):
        seen.append(contents.camera.intrinsics)
        return {}

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(FORMATS, tool, replace(record, write=remember))
        export(camera, tmp_path / "camera", tool)
    assert (seen[0].cx, seen[0].cy) == (record.pixel_origin, record.pixel_origin)


@for_every_tool
def test_a_skew_goes_along_or_is_fitted_away_and_said(tmp_path, tool):
    record = FORMATS[tool]
    camera = Camera(SIZE, Intrinsics(400.0, 400.0, 320.0, 240.0, 0.5), Brown(k1=0.01))
    exported = export(camera, tmp_path / f"camera{record.suffixes[0]}", tool)
    if record.skew:
        assert exported.held.camera is camera
    else:
        assert "a skew of 0.5 px" in exported.remarks()[0]
        assert 0 < exported.held.apart_px < 0.5  # half the skew at the sides
        again = load_camera(tmp_path / f"camera{record.suffixes[0]}", **size_for(tool))
        assert farthest_apart(exported.held.camera, again) < 1e-9
    assert exported.held.camera.intrinsics.skew == (0.5 if record.skew else 0.0)


@for_every_tool
def test_what_is_written_again_is_the_same_bytes(tmp_path, tool):
    record = FORMATS[tool]
    for suffix in record.suffixes:
        first, second = tmp_path / f"cameras{suffix}", tmp_path / "again" / f"cameras{suffix}"
        export(camera_held(record, record.holdings[0]), first, tool)
        export(load_camera(first, **size_for(tool)), second, tool)
        again = load_camera(second, **size_for(tool))
        assert farthest_apart(load_camera(first, **size_for(tool)), again) < 1e-9


@for_every_tool
def test_each_record_says_what_people_must_know(tool):
    record = FORMATS[tool]
    assert record.name == tool
    assert re.fullmatch(r"[a-z]+", tool)
    assert all(suffix.startswith(".") for suffix in record.suffixes)
    assert all(re.fullmatch(r"[a-z_]+(:[a-z0-9_,]+)?", lens) for lens in record.lenses)
    assert record.remarks == "" or record.remarks.endswith(".")


@for_every_tool
def test_a_file_cut_off_is_the_same_camera_or_an_input_error(tmp_path, tool):
    record = FORMATS[tool]
    for suffix in record.suffixes:
        place = tmp_path / f"cameras{suffix}"
        camera = camera_held(record, record.holdings[0])
        export(camera, place, tool)
        content, refused = place.read_bytes(), 0
        for share in (0.1, 0.3, 0.5, 0.7, 0.9):
            place.write_bytes(content[: int(share * len(content))])
            try:
                again = load_camera(place, **size_for(tool))
            except InputError as error:
                refused += str(place) in str(error)
            else:
                assert farthest_apart(camera, again) < 1e-9
        assert refused >= 3


def test_a_name_with_a_blank_stands_in_colmaps_binary_file_only(tmp_path):
    camera = Camera(SIZE, Intrinsics(400.0, 400.0, 320.0, 240.0), Brown(k1=0.01))
    source = Contents(camera, {"a b.png": poses()["a.png"]})
    with pytest.raises(InputError, match=r"'a b\.png' cannot stand in COLMAP's images\.txt"):
        export(source, tmp_path / "cameras.txt", "colmap")
    assert list(tmp_path.iterdir()) == []
    export(source, tmp_path / "cameras.bin", "colmap")
    assert list(load_contents(tmp_path / "cameras.bin").poses) == ["a b.png"]


def test_a_file_of_no_tool_names_the_tools(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing here\n")
    with pytest.raises(InputError, match=r"holds no camera that is known here; expected a file of .*COLMAP"):
        load_camera(tmp_path / "notes.txt")


def test_of_several_cameras_one_is_named(tmp_path):
    one = Camera(SIZE, Intrinsics(400.0, 400.0, 320.0, 240.0), Brown(k1=0.01))
    export(one, tmp_path / "one.yaml", "kalibr")
    text = (tmp_path / "one.yaml").read_text()
    place = tmp_path / "two.yaml"
    place.write_text(text + text.replace("cam0", "cam1").replace("400.0", "500.0"))
    with pytest.raises(InputError, match=r"has 2 cameras \(cam0, cam1\); expected one\. Name it: .*#NAME"):
        load_camera(place)
    assert load_camera(f"{place}#cam1").intrinsics.fx == 500.0
    assert load_camera(place, name="cam0").intrinsics.fx == 400.0
    with pytest.raises(InputError, match=r"has no camera 'cam7'; it has cam0, cam1"):
        load_camera(Path(f"{place}#cam7"))


def test_of_a_wide_lens_the_share_that_the_tool_cannot_show_is_said(tmp_path):
    wide = Camera(SIZE, Intrinsics(180.0, 180.0, 320.0, 240.0), KannalaBrandt(k1=-0.01))
    told = export(wide, tmp_path / "camera.yaml", "opencv").remarks()
    rays = wide.unproject(np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1).reshape(-1, 2))
    share = (rays[:, 2] < 0).mean()
    found = re.match(r"([\d.]+) % of the frame looks farther than 90 degrees", told[-1])
    assert found
    assert float(found[1]) == pytest.approx(100 * share, rel=0.02)
    assert export(wide, tmp_path / "calib.json", "basalt").remarks() == ()
