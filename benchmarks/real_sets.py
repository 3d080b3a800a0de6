"""Photographs and corners that other people made, from the folder that ORTHOSCOPE_DATASETS names."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import ndarray
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import Target, chessboard

__all__ = ["SETS", "RealSet", "babel_cube", "classic_corners", "datasets", "zhang"]


class RealSet(NamedTuple):
    """Where the corners and the photographs of a chessboard are, how many inner corners it has, and the lens
    that suits the camera.
    """

    corners: str
    photographs: str
    grid: tuple[int, int]
    lens: str = "brown"


SETS = {
    "opencv-left": RealSet("opencv-left/corners.npz", "opencv-left/*", (9, 6)),
    "udacity": RealSet("udacity/corners.npz", "udacity/*", (9, 6)),
    "sony": RealSet("sony/corners.npz", "sony/*", (6, 4)),
    "bumblebee-left": RealSet("bumblebee/corners-boof-bumblebee-left.npz", "bumblebee/left*", (6, 4)),
    "bumblebee-right": RealSet("bumblebee/corners-boof-bumblebee-right.npz", "bumblebee/right*", (6, 4)),
    "calibrel": RealSet("calibrel/corners.npz", "calibrel/*", (16, 10)),
    "fisheye-180": RealSet("fisheye-180/corners.npz", "fisheye-180/*", (6, 4), "kannala_brandt"),
}


def datasets() -> Path | None:
    """The folder, where it is there."""
    named = os.environ.get("ORTHOSCOPE_DATASETS")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "shared/datasets"
    return folder if folder.is_dir() else None


def classic_corners(folder: Path, name: str) -> Detections:
    """The whole boards of a set as OpenCV's classic finder and cornerSubPix found them."""
    table = np.load(folder / SETS[name].corners)
    points = table["object_points"].astype(float)
    columns, rows = SETS[name].grid
    target = chessboard(columns, rows, float(points[1, 0] - points[0, 0]))
    pixels = table["image_points_classic"].astype(float)
    found = np.isfinite(pixels).all((1, 2))
    ids = np.arange(len(points))
    views = [
        View(str(file), ids, seen) for file, seen in zip(table["files"][found], pixels[found], strict=True)
    ]
    return Detections(target, _image_size(table), tuple(views))


def zhang(folder: Path) -> Detections:
    """Zhang's five views of 256 corners."""
    (views,), points, size = _ragged(folder, ["zhang/corners.npz"])
    return Detections(Target("zhang", points), size, views)


def babel_cube(folder: Path) -> tuple[Detections, int]:
    """The views of babel-cube, first those to learn from, then the published test views; and how many are to
    learn from.
    """
    (train, test), points, size = _ragged(
        folder, ["babel-cube/corners-train.npz", "babel-cube/corners-test.npz"]
    )
    grid = (len(np.unique(points[:, 0])), len(np.unique(points[:, 1])))
    return Detections(Target("babel-cube", points, grid=grid), size, (*train, *test)), len(train)


def _ragged(folder: Path, names: list[str]) -> tuple[list[tuple[View, ...]], ndarray, tuple[int, int]]:
    """Views of each table over one target: all points that any view has."""
    tables = [np.load(folder / name) for name in names]
    points, ids = np.unique(
        np.concatenate([table["object_points"] for table in tables]), axis=0, return_inverse=True
    )
    parts = np.split(ids.ravel(), np.cumsum([len(table["view"]) for table in tables])[:-1])
    splits = [_views(table, part, name) for table, part, name in zip(tables, parts, names, strict=True)]
    return splits, points, _image_size(tables[0])


def _views(table, ids: ndarray, name: str) -> tuple[View, ...]:
    rows = [table["view"] == view for view in range(len(table["files"]))]
    return tuple(
        View(f"{Path(name).stem} {i:02d}", ids[seen], table["image_points"][seen])
        for i, seen in enumerate(rows)
    )


def _image_size(table) -> tuple[int, int]:
    width, height = table["image_size"]
    return int(width), int(height)
