"""Cameras to write for every tool: of each lens that it has, and what no tool has."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from orthoscope.formats.record import Format, Holding
from orthoscope.geometry.pose import Pose, rotation_from_vector
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import FREE, LENSES

__all__ = ["SIZE", "camera_held", "farthest_apart", "poses", "some_pixels"]

SIZE = (640, 480)
# A value for each coefficient, small enough that no formula folds within the frame.
USUAL = {"k": 0.03, "p": 1e-3, "s": 1e-3, "t": 0.01, "w": 0.8, "l": 0.1, "a": 0.02}
# Of coefficients that go by a Greek letter.
GREEK = {"xi": -0.1, "alpha": 0.6, "beta": 0.9}


def camera_held(record: Format, holding: Holding, *, focal: float = 400.0 + 1 / 3) -> Camera:
    """A camera with all that the tool can hold: every coefficient of the lens, and K."""
    kind = LENSES["brown" if holding.lens == FREE else holding.lens]
    signs = {name: (-1.0) ** i for i, name in enumerate(kind.names())}
    values = {
        name: GREEK.get(name) or USUAL[name[0]] * (signs[name] if name[0] in "kpsta" else 1.0)
        for name in holding.coefficients
        if name in kind.names() and name not in ("a0", "a1", "scale")
    }
    fy = focal * 1.01 if record.two_focals else focal
    skew = 0.7 if record.skew else 0.0
    frame = Intrinsics(focal * 1.02, fy, 322.0, 238.0, 0.1) if record.own_centre else None
    intrinsics = Intrinsics(focal, fy, 319.5 + 1e-5, 237.25, skew)
    return Camera(SIZE, intrinsics, kind().with_coefficients(**values), frame)


def some_pixels() -> ndarray:
    """Pixels all over the frame, its corners among them."""
    x, y = np.meshgrid(np.linspace(0, SIZE[0] - 1, 13), np.linspace(0, SIZE[1] - 1, 9))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def farthest_apart(camera: Camera, other: Camera) -> float:
    """The largest distance of two cameras' images of the same rays, pixels; infinite where one has none."""
    rays = camera.unproject(some_pixels())
    seen = np.isfinite(rays).all(1)
    assert seen.mean() > 0.5
    apart = np.hypot(*(other.project(rays[seen]) - camera.project(rays[seen])).T)
    return float(np.nan_to_num(apart, nan=np.inf).max())


def poses() -> dict[str, Pose]:
    """Poses of three photographs, one of them in a folder."""
    rng = np.random.default_rng(0)
    return {
        name: Pose(rotation_from_vector(rng.normal(size=3)), rng.normal(size=3))
        for name in ("a.png", "b-c.png", "sub/d.jpg")
    }
