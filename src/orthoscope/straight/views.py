"""What a straight picture shows and how: its camera, chosen by what to keep, by field of view, size and
projection.

A rectilinear picture is a pin-hole's: straight lines are straight, and nothing beside or behind the camera is
in it. Wide lenses may be shown otherwise: `equidistant` and `stereographic` are lenses of the table (the
latter keeps small shapes), `cylindrical` keeps upright lines straight, `equirectangular` has longitude and
latitude as its axes. Angles grow from the camera's axis; a view has the camera's aspect, so that squares stay
squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.models.camera import WIDEST_ANGLE, Camera, image_border
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown, KannalaBrandt, Stereographic
from orthoscope.models.smooth_map import smooth_map

__all__ = ["PROJECTIONS", "Panorama", "View", "map_of", "share_kept", "straight_camera"]

# Pixels of the frame, across and down, by which it is said which share of it a view shows.
SHARE_GRID = (64, 48)


@dataclass(frozen=True, eq=False)
class Panorama:
    """A camera whose picture is a part of a cylinder or of a sphere, unrolled.

    Attributes:
        image_size: (width, height).
        intrinsics: pixels of a place, angle across and height up the cylinder or angle up the sphere.
        upright: whether it is a sphere's, with angles both ways.
    """

    image_size: tuple[int, int]
    intrinsics: Intrinsics
    upright: bool

    def unproject(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit rays of pixels; NaN past the half turn and past the poles."""
        across, up = self.intrinsics.place(*pixels.T)
        height = np.tan(up) if self.upright else up
        rays = np.stack([np.sin(across), height, np.cos(across)], axis=-1)
        rays = rays / np.sqrt(1.0 + height * height)[:, None]
        beyond = (np.abs(across) > np.pi) | (self.upright & (np.abs(up) > 0.5 * np.pi))
        rays[beyond] = np.nan
        return rays

    def project(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
        """Pixels of points in the camera frame."""
        across = np.arctan2(points[:, 0], points[:, 2])
        height = points[:, 1] / np.hypot(points[:, 0], points[:, 2])
        return self.intrinsics.to_pixels(
            np.stack([across, np.arctan(height) if self.upright else height], axis=-1)
        )


View = Camera | Panorama


class Projection(NamedTuple):
    """How rays are shown.

    Attributes:
        view: the camera of a size and a pin-hole.
        farthest: the largest angle from the axis that is kept, radians, unless one asks for more.
    """

    view: Callable[[tuple[int, int], Intrinsics], View]
    farthest: float


PROJECTIONS: dict[str, Projection] = {
    "rectilinear": Projection(lambda size, pin_hole: Camera(size, pin_hole, Brown()), WIDEST_ANGLE),
    "equidistant": Projection(lambda size, pin_hole: Camera(size, pin_hole, KannalaBrandt()), np.pi),
    "stereographic": Projection(
        lambda size, pin_hole: Camera(size, pin_hole, Stereographic()), np.deg2rad(150.0)
    ),
    "cylindrical": Projection(lambda size, pin_hole: Panorama(size, pin_hole, False), np.deg2rad(150.0)),
    "equirectangular": Projection(lambda size, pin_hole: Panorama(size, pin_hole, True), np.pi),
}


def straight_camera(
    camera: Camera,
    *,
    keep: str = "all",
    size: tuple[int, int] | None = None,
    fov: float | None = None,
    scale: float | None = None,
    projection: str = "rectilinear",
) -> View:
    """The camera of straight pictures.

    Args:
        keep: `all` that was photographed, or only places that were (`valid`), where neither `fov` nor `scale`
            says how much is shown.
        size: (width, height) of the pictures; by default the camera's.
        fov: degrees that the picture shows across.
        scale: straight pixels for one of the camera's at its principal point.
        projection: one of PROJECTIONS.
    Raises:
        InputError: a word, an angle or a scale that cannot be.
    """
    if projection not in PROJECTIONS:
        raise InputError(f"projection {projection!r} is not known; expected one of {', '.join(PROJECTIONS)}.")
    if keep not in ("all", "valid"):
        raise InputError(
            f"keep is {keep!r}; expected 'all' (every photographed pixel) or 'valid' (no black border)."
        )
    if fov is not None and scale is not None:
        raise InputError("both fov and scale were given; expected one of them. Drop the other.")
    size = size or camera.image_size
    show = PROJECTIONS[projection].view
    if fov is not None:
        return show(size, _across(camera, size, fov, show, projection))
    if scale is not None:
        if not (np.isfinite(scale) and scale > 0):
            raise InputError(f"a scale of {scale:g} shows nothing; expected a positive number.")
        return show(size, _about_axis(camera, size, scale * _slope(camera) * camera.intrinsics.fx))
    if projection == "rectilinear":
        return show(size, camera.straight_intrinsics(keep, size=size))
    if keep == "valid":
        raise InputError(
            f"keep='valid' is for rectilinear pictures; of {projection} ones choose what is shown by a field"
            f" of view"
            " (--fov)."
        )
    return show(size, _around(camera, size, show, PROJECTIONS[projection].farthest))


def share_kept(camera: Camera, view: View) -> float:
    """The share of the camera's pixels with rays that a view shows."""
    (width, height), (across, down) = camera.image_size, SHARE_GRID
    x, y = np.meshgrid((np.arange(across) + 0.5) * width / across, (np.arange(down) + 0.5) * height / down)
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=-1) - 0.5)
    rays = rays[np.isfinite(rays).all(1)]
    seen = view.project(rays)
    inside = (seen >= -0.5).all(1) & (seen <= np.array(view.image_size) - 0.5).all(1)
    return float(inside.mean()) if len(rays) else 0.0


def map_of(camera: Camera, view: View) -> tuple[ndarray, ndarray]:
    """For each pixel of the view, where to look in the camera's photograph: x and y, float32; NaN where
    nowhere.
    """
    if isinstance(view, Camera):
        return camera.view_map(view)
    return smooth_map(
        lambda pixels: camera.project(view.unproject(pixels)),
        view.image_size,
        vouched=lambda pixels: np.zeros(len(pixels), dtype=bool),
        limits=camera.image_size,
    )


def _about_axis(camera: Camera, size: tuple[int, int], fx: float) -> Intrinsics:
    """A pin-hole with the axis in the middle of the picture and the camera's aspect."""
    aspect = camera.intrinsics.fy / camera.intrinsics.fx
    return Intrinsics(fx, aspect * fx, 0.5 * (size[0] - 1), 0.5 * (size[1] - 1))


def _across(
    camera: Camera, size: tuple[int, int], fov: float, show: Callable[..., View], projection: str
) -> Intrinsics:
    """A pin-hole by which the picture shows an angle across, degrees, from its left side to its right."""
    widest = 180.0 if projection == "rectilinear" else 360.0
    if not 0 < fov < widest:
        raise InputError(
            f"a field of view of {fov:g} degrees cannot be {projection}; expected 0 to {widest:g}."
        )
    half = np.deg2rad(0.5 * fov)
    unit = show(size, Intrinsics(1.0, 1.0, 0.0, 0.0))
    ((x, _),) = unit.project(np.array([[np.sin(half), 0.0, np.cos(half)]]))
    if not x > 0:
        raise InputError(f"a field of view of {fov:g} degrees cannot be {projection}. Choose a smaller one.")
    return _about_axis(camera, size, float(0.5 * size[0] / x))


def _slope(camera: Camera) -> float:
    """How much the lens itself enlarges at its centre."""
    gain, _ = camera.lens.gain(np.full(1, 1e-12))
    return float(gain[0])


def _around(camera: Camera, size: tuple[int, int], show: Callable[..., View], farthest: float) -> Intrinsics:
    """A pin-hole by which the picture shows all rays of the camera's border, up to an angle from the axis."""
    rays = np.concatenate([camera.unproject(image_border(camera.image_size)), _rays_inside(camera)])
    rays = rays[np.isfinite(rays).all(1) & (rays[:, 2] >= np.cos(farthest))]
    if not len(rays):
        raise InputError("no ray of this camera can be shown so. Choose another projection.")
    aspect = np.array([camera.intrinsics.fx, camera.intrinsics.fy])
    places = show(size, Intrinsics(1.0, 1.0, 0.0, 0.0)).project(rays) * aspect
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    reach = np.array(size) - 1.0
    scale, middle = float((reach / (high - low)).min()), 0.5 * (low + high)
    (fx, fy), (cx, cy) = scale * aspect, 0.5 * reach - scale * middle
    return Intrinsics(float(fx), float(fy), float(cx), float(cy))


def _rays_inside(camera: Camera) -> ndarray:
    """Rays all over the frame: of a fish-eye's, the border has none."""
    (width, height), (across, down) = camera.image_size, SHARE_GRID
    x, y = np.meshgrid(np.linspace(0, width - 1, across), np.linspace(0, height - 1, down))
    return camera.unproject(np.stack([x.ravel(), y.ravel()], axis=-1))
