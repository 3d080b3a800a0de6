"""Corners that run the other way round than on a board's front are told of, whatever file has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orthoscope.formats.corners_vnl import read_vnl, write_vnl
from orthoscope.formats.own.json import load_detections, save
from orthoscope.targets.detections import Detections, View, view_name
from orthoscope.targets.mirrored import with_word_of_mirrors
from orthoscope.targets.table import parse_target
from orthoscope.targets.target import Target

SPECS = "chessboard:5x4:25mm", "circles:4x5:20mm:asymmetric", "charuco:5x4:30mm:22mm:DICT_4X4_50"
SIZE = (640, 480)


def seen(spec: str, *, mirrored: int, views: int = 3) -> Detections:
    """Views of a board from the front, so many of them mirrored, each turned on its own."""
    target, found = parse_target(spec), []
    for number in range(views):
        turn = 0.7 * number
        axes = 1000.0 * np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        points = target.points[:, :2] - target.points[:, :2].mean(0)
        pixels = points @ axes * ([-1.0, 1.0] if number < mirrored else [1.0, 1.0]) + [320.0, 240.0]
        found.append(View(f"{number}.jpg", np.arange(len(points)), pixels))
    return Detections(target, SIZE, tuple(found))


@pytest.mark.parametrize("spec", SPECS)
def test_a_file_of_mirrored_corners_is_told_of_and_what_to_look_at(tmp_path, spec):
    for mirrored in range(4):
        given = seen(spec, mirrored=mirrored)
        save(given, tmp_path / "detections.json")
        write_vnl(given, tmp_path / "corners.vnl")
        for read in (
            load_detections(tmp_path / "detections.json"),
            read_vnl(tmp_path / "corners.vnl", given.target, SIZE),
        ):
            if mirrored < 2:
                assert not read.remarks
                continue
            (remark,) = read.remarks
            assert remark.image == "0.jpg"
            assert f"a mirror image of {spec}, as are {mirrored} of 3 views; expected" in remark.words
            assert "See that" in remark.words


def test_it_is_told_once_though_a_file_is_written_again(tmp_path):
    save(with_word_of_mirrors(seen(SPECS[0], mirrored=3)), tmp_path / "detections.json")
    assert len(load_detections(tmp_path / "detections.json").remarks) == 1


def test_of_several_boards_the_one_that_is_mirrored_is_named():
    one, other = seen(SPECS[0], mirrored=0), seen(SPECS[1], mirrored=3)
    target = parse_target(" + ".join(SPECS[:2]))
    views = [
        replace(view, image=view_name(view.image, number), ids=view.ids + part.start)
        for number, (part, detections) in enumerate(zip(target.parts, (one, other), strict=True))
        for view in detections.views
    ]
    (remark,) = with_word_of_mirrors(Detections(target, SIZE, tuple(views))).remarks
    assert remark.words.startswith(f"a mirror image of {SPECS[1]}, as are 3 of 3 views")


def test_of_points_of_ones_own_nobody_knows_the_front():
    points = parse_target(SPECS[0]).points
    given = seen(SPECS[0], mirrored=3)
    own = replace(given, target=Target("own", points))
    assert with_word_of_mirrors(own) is own
