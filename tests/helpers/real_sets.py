"""Corners that others found in real photographs, as Detections; docs of the sets stand beside them, in the
folder of photographs.

A corner's id is its row of `object_points`; where these differ from view to view the target is all the points
that any view has.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target

__all__ = ["CLASSIC", "babel_cube", "classic", "zhang"]

CLASSIC = {  # name: file of corners in the folder of photographs
    "opencv-left": "opencv-left/corners.npz",
    "udacity": "udacity/corners.npz",
    "sony": "sony/corners.npz",
    "bumblebee-left": "bumblebee/corners-boof-bumblebee-left.npz",
    "bumblebee-right": "bumblebee/corners-boof-bumblebee-right.npz",
    "calibrel": "calibrel/corners.npz",
    "fisheye-180": "fisheye-180/corners.npz",
}


def classic(folder: Path, name: str) -> Detections:
    """The whole boards of a set, found by OpenCV's classic detector."""
    table = np.load(folder / CLASSIC[name])
    target = Target(name, table["object_points"].astype(float))
    ids = np.arange(len(target.points))
    pixels = table["image_points_classic"].astype(float)
    found = np.isfinite(pixels).all((1, 2))
    views = [
        View(str(file), ids, seen) for file, seen in zip(table["files"][found], pixels[found], strict=True)
    ]
    return Detections(target, _image_size(table), tuple(views))


def zhang(folder: Path) -> Detections:
    """Zhang's five views of 256 corners, the target in inches."""
    (detections,) = _ragged("zhang", np.load(folder / "zhang/corners.npz"))
    return detections


def babel_cube(folder: Path) -> tuple[Detections, Detections]:
    """The published training and test views; several boards make one target, so that both share it."""
    train, test = _ragged(
        "babel-cube", *(np.load(folder / f"babel-cube/corners-{split}.npz") for split in ("train", "test"))
    )
    return train, test


def _ragged(name: str, *tables) -> tuple[Detections, ...]:
    points, ids = np.unique(
        np.concatenate([table["object_points"] for table in tables]), axis=0, return_inverse=True
    )
    target, splits = Target(name, points), np.cumsum([len(table["view"]) for table in tables])[:-1]
    return tuple(
        _detections(target, table, part)
        for table, part in zip(tables, np.split(ids.ravel(), splits), strict=True)
    )


def _detections(target: Target, table, ids: np.ndarray) -> Detections:
    views = []
    for view, file in enumerate(table["files"]):
        rows = table["view"] == view
        views.append(View(f"{view:02d} {file}", ids[rows], table["image_points"][rows]))
    return Detections(target, _image_size(table), tuple(views))


def _image_size(table) -> tuple[int, int]:
    width, height = table["image_size"]
    return int(width), int(height)
