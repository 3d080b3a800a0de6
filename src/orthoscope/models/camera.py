"""The pin-hole with its lens: Intrinsics, Camera, and the maps that straighten photographs.

Floor 1.  K = [fx skew cx; 0 fy cy; 0 0 1] (the paper's A = [alpha gamma u0; 0 beta v0; 0 0 1]).  A point becomes a ray, a place in the
lens's chart, a distorted place, a pixel (docs/conventions.md).  With a lens frame L the ray is turned by L^-1 K first and L
takes the place of K at the end: the lens then acts about its own distortion centre.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray
from orthoscope.models.lens import Lens

__all__ = ["WIDEST", "Camera", "Intrinsics", "image_border"]

WIDEST = np.deg2rad(75.0)  # rays farther from the axis than this a pin-hole stretches without end
BLOCK = 32768  # pixels of an undistortion map that are made at once, so that the intermediate arrays stay in cache


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """The pin-hole, pixels: u = fx x + skew y + cx, v = fy y + cy.

    Raises InputError where a focal length is not positive or a number is not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0

    def __post_init__(self) -> None:
        for name, value in zip(("fx", "fy", "cx", "cy", "skew"), frozen(self.as_tuple(), (5,), "intrinsics"), strict=True):
            object.__setattr__(self, name, float(value))
        if self.fx <= 0 or self.fy <= 0:
            raise InputError(f"focal lengths are {self.fx:g} and {self.fy:g} px; expected positive ones.")

    def as_tuple(self) -> tuple[float, float, float, float, float]:
        """(fx, fy, cx, cy, skew)."""
        return self.fx, self.fy, self.cx, self.cy, self.skew

    @property
    def matrix(self) -> Float[ndarray, "3 3"]:
        """K (3,3)."""
        return np.array([[self.fx, self.skew, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def to_pixels(self, plane: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """Pixels of places in the lens's plane."""
        x, y = plane[:, 0], plane[:, 1]
        return np.stack([self.fx * x + self.skew * y + self.cx, self.fy * y + self.cy], axis=-1)

    def to_plane(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """Places in the lens's plane of pixels."""
        y = (pixels[:, 1] - self.cy) / self.fy
        return np.stack([(pixels[:, 0] - self.cx - self.skew * y) / self.fx, y], axis=-1)


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera.

    image_size: (width, height).  lens_frame: intrinsics of the lens's own plane where its distortion centre is not the principal
    point; None means the intrinsics themselves.
    Raises InputError for an image without size.
    """

    image_size: tuple[int, int]
    intrinsics: Intrinsics
    lens: Lens
    lens_frame: Intrinsics | None = None

    def __post_init__(self) -> None:
        width, height = (int(side) for side in self.image_size)
        if width < 1 or height < 1:
            raise InputError(f"image_size is {self.image_size}; expected (width, height) in pixels.")
        object.__setattr__(self, "image_size", (width, height))

    def project(self, points: Float[ndarray, "n 3"], *, beyond: bool = False) -> Float[ndarray, "n 2"]:
        """Pixels (n,2) of points (n,3) in the camera frame, any unit; NaN where the lens gives them no image.

        beyond: let the formula go on where the lens's domain has ended, as least squares does; such pixels are no images.
        """
        if self.lens_frame is None:
            return self.intrinsics.to_pixels(self.lens.distort(points, beyond=beyond))
        lens_from_camera = np.linalg.solve(self.lens_frame.matrix, self.intrinsics.matrix)
        return self.lens_frame.to_pixels(self.lens.distort(points @ lens_from_camera.T, beyond=beyond))

    def unproject(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit rays (n,3), camera frame, that fall on pixels (n,2); NaN where none does."""
        frame = self.lens_frame or self.intrinsics
        rays = self.lens.undistort(frame.to_plane(pixels))
        if self.lens_frame is None:
            return rays
        rays = rays @ np.linalg.solve(self.intrinsics.matrix, self.lens_frame.matrix).T
        return rays / np.sqrt((rays * rays).sum(-1, keepdims=True))

    def with_unit_scale(self) -> Camera:
        """The same images, with the lens's own scale (if its formula has one) moved to K: fx, fy then are the scale at the centre."""
        name = self.lens.scaled_by
        if name is None or self.lens_frame is not None:
            return self
        scale = float(self.lens.gain(np.zeros(1))[0][0])
        fx, fy, cx, cy, skew = self.intrinsics.as_tuple()
        lens = self.lens.with_coefficients(**{name: getattr(self.lens, name) / scale})
        return replace(self, intrinsics=Intrinsics(scale * fx, scale * fy, cx, cy, scale * skew), lens=lens)

    def undistort_pixels(self, pixels: Float[ndarray, "n 2"], straight: Intrinsics | None = None) -> Float[ndarray, "n 2"]:
        """Where a pin-hole camera (`straight`, default this camera's own K) would see what these pixels show; NaN where it cannot."""
        rays = self.unproject(pixels)
        front = np.where(rays[:, 2:] > 0, rays[:, 2:], np.nan)
        return (straight or self.intrinsics).to_pixels(rays[:, :2] / front)

    def distort_pixels(self, pixels: Float[ndarray, "n 2"], straight: Intrinsics | None = None) -> Float[ndarray, "n 2"]:
        """The inverse of `undistort_pixels`: where this camera sees what a pin-hole camera sees at these pixels."""
        plane = (straight or self.intrinsics).to_plane(pixels)
        return self.project(np.concatenate([plane, np.ones((len(plane), 1))], axis=-1))

    def undistort_map(
        self, straight: Intrinsics | None = None, size: tuple[int, int] | None = None
    ) -> tuple[Float[ndarray, "h w"], Float[ndarray, "h w"]]:
        """For each pixel of the straight image, where to look in the photograph: x and y, float32 as cv2.remap takes them.

        straight, size: intrinsics and (width, height) of the straight image, by default this camera's.  NaN where a ray lies beyond the
        lens's domain or its image outside the photograph by more than a pixel, so that nothing folds back.
        """
        straight, (width, height) = straight or self.intrinsics, size or self.image_size
        maps = np.empty((2, height, width), dtype=np.float32)
        for rows in _row_blocks(width, height):
            y, x = np.mgrid[rows.start : rows.stop, 0:width].astype(float).reshape(2, -1)
            u, v = self.distort_pixels(np.stack([x, y], axis=-1), straight).T
            u[(u < -1.0) | (u > self.image_size[0]) | (v < -1.0) | (v > self.image_size[1])] = np.nan
            v[np.isnan(u)] = np.nan
            maps[:, rows] = np.stack([u, v]).reshape(2, rows.stop - rows.start, width)
        return maps[0], maps[1]

    def straight_intrinsics(self, keep: str = "all", widest: float = WIDEST) -> Intrinsics:
        """A pin-hole for the straight image, same size: `all` keeps every photographed pixel, `valid` only places that were photographed.

        widest: no ray farther than this from the axis (radians) is kept, since a pin-hole stretches it without end.
        Raises InputError for another word.  The paper: section 4.2, Fig. 7.
        """
        if keep not in ("all", "valid"):
            raise InputError(f"keep is {keep!r}; expected 'all' (every photographed pixel) or 'valid' (no black border).")
        border = image_border(self.image_size)
        centre = np.array([[self.intrinsics.cx, self.intrinsics.cy]])
        rays = self._border_rays(border, centre, widest)
        plane = rays[:, :2] / rays[:, 2:]
        width, height = self.image_size
        if keep == "all":
            low, high = plane.min(0), plane.max(0)
        else:
            low, high = _inner_rectangle(plane, width / height)
        focal = np.array([width - 1.0, height - 1.0]) / (high - low)
        return Intrinsics(focal[0], focal[1], -focal[0] * low[0], -focal[1] * low[1])

    def _border_rays(self, border: ndarray, centre: ndarray, widest: float) -> ndarray:
        """Rays of the image's border; where a border pixel has none within `widest`, of the last pixel towards the centre that has."""
        inside, outside = np.zeros(len(border)), np.ones(len(border))
        for _ in range(40):
            rays = self.unproject(centre + outside[:, None] * (border - centre))
            if (good := rays[:, 2] >= np.cos(widest)).all():
                return rays
            middle = np.where(good, outside, 0.5 * (inside + outside))
            reached = self.unproject(centre + middle[:, None] * (border - centre))[:, 2] >= np.cos(widest)
            inside, outside = np.where(reached, middle, inside), np.where(reached, outside, middle)
            if (outside - inside).max() < 1e-6:
                break
        return self.unproject(centre + inside[:, None] * (border - centre))


def image_border(image_size: tuple[int, int], samples: int = 64) -> Float[ndarray, "n 2"]:
    """Pixels along the four sides of an image, clockwise from the top left, each corner once."""
    right, bottom = image_size[0] - 1.0, image_size[1] - 1.0
    t = np.arange(samples) / samples
    corners = np.array([[0, 0], [right, 0], [right, bottom], [0, bottom]])
    return np.concatenate([a + t[:, None] * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])


def _inner_rectangle(plane: ndarray, aspect: float) -> tuple[ndarray, ndarray]:
    """A large upright rectangle of the given aspect inside the closed curve `plane`, grown from the curve's middle."""
    middle = 0.5 * (plane.min(0) + plane.max(0))
    side = plane - middle
    # the curve meets the rectangle's boundary where max(|x| / aspect, |y|) is least
    half = np.maximum(np.abs(side[:, 0]) / aspect, np.abs(side[:, 1])).min()
    reach = np.array([half * aspect, half])
    return middle - reach, middle + reach


def _row_blocks(width: int, height: int) -> Iterator[slice]:
    rows = max(1, BLOCK // width)
    for start in range(0, height, rows):
        yield slice(start, min(start + rows, height))
