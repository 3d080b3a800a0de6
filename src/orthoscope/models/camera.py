"""The pin-hole with its lens: Intrinsics, Camera, and the maps that straighten photographs.

K = [fx skew cx; 0 fy cy; 0 0 1] (the paper's A = [alpha gamma u0; 0 beta v0; 0 0 1]). A point becomes a ray,
a place in the lens's chart, a distorted place, a pixel (docs/conventions.md). With a lens frame L the ray is
turned by L^-1 K first and L takes the place of K at the end: the lens then acts about its own distortion
centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, frozen, ndarray
from orthoscope.models.chunks import in_blocks
from orthoscope.models.lens import Lens
from orthoscope.models.smooth_map import smooth_map

__all__ = ["WIDEST", "Camera", "Intrinsics", "image_border"]

WIDEST = np.deg2rad(75.0)  # rays farther from the axis than this a pin-hole stretches without end


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
        for name, value in zip(
            ("fx", "fy", "cx", "cy", "skew"), frozen(self.as_tuple(), (5,), "intrinsics"), strict=True
        ):
            object.__setattr__(self, name, float(value))
        if self.fx <= 0 or self.fy <= 0:
            raise InputError(f"focal lengths are {self.fx:g} and {self.fy:g} px; expected positive ones.")

    def as_tuple(self) -> tuple[float, float, float, float, float]:
        """(fx, fy, cx, cy, skew)."""
        return self.fx, self.fy, self.cx, self.cy, self.skew

    def after(self, undone: Intrinsics, done: Intrinsics) -> Intrinsics:
        """The pin-hole that does what `done` does, undoes `undone` and then does this: K times undone^-1
        times done.
        """
        if undone is done:
            return self
        (fx, skew, cx), (_, fy, cy), _ = self.matrix @ np.linalg.solve(undone.matrix, done.matrix)
        return Intrinsics(fx, fy, cx, cy, skew)

    @property
    def matrix(self) -> Float[ndarray, "3 3"]:
        """K (3,3)."""
        return np.array([[self.fx, self.skew, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def to_pixels(self, plane: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """Pixels of places in the lens's plane."""
        return np.stack(self.pixel(plane[:, 0], plane[:, 1]), axis=-1)

    def to_plane(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        """Places in the lens's plane of pixels."""
        return np.stack(self.place(pixels[:, 0], pixels[:, 1]), axis=-1)

    def pixel(self, x: ndarray, y: ndarray) -> tuple[ndarray, ndarray]:
        """The pixel (u, v) of a place in the lens's plane."""
        u = self.fx * x + self.cx
        return (u + self.skew * y if self.skew else u), self.fy * y + self.cy

    def place(self, u: ndarray, v: ndarray) -> tuple[ndarray, ndarray]:
        """The place (x, y) in the lens's plane of a pixel."""
        y = (v - self.cy) / self.fy
        x = u - self.cx
        return (x - self.skew * y if self.skew else x) / self.fx, y


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera.

    image_size: (width, height). lens_frame: intrinsics of the lens's own plane where its distortion centre is
    not the principal point; None means the intrinsics themselves. Raises InputError for an image without
    size.
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

        beyond: let the formula go on where the lens's domain has ended, as least squares does; such pixels
        are no images.
        """
        return (self.lens_frame or self.intrinsics).to_pixels(
            self.lens.distort(self._lens_rays(points), beyond=beyond)
        )

    def unproject(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit rays (n,3), camera frame, that fall on pixels (n,2); NaN where none does."""
        frame = self.lens_frame or self.intrinsics
        rays = in_blocks(
            lambda u, v: self.lens.chart.lift(*self.lens.unwarp(*frame.place(u, v))), pixels, width=3
        )
        if self.lens_frame is None:
            return rays
        rays = rays @ np.linalg.solve(self.intrinsics.matrix, self.lens_frame.matrix).T
        return rays / np.sqrt((rays * rays).sum(-1, keepdims=True))

    def with_unit_scale(self) -> Camera:
        """The same images, with the lens's own scale (if its formula has one) moved to K: fx, fy then are the
        scale at the centre.
        """
        name = self.lens.scaled_by
        if name is None or self.lens_frame is not None:
            return self
        scale = float(self.lens.gain(np.zeros(1))[0][0])
        fx, fy, cx, cy, skew = self.intrinsics.as_tuple()
        lens = self.lens.with_coefficients(**{name: getattr(self.lens, name) / scale})
        return replace(self, intrinsics=Intrinsics(scale * fx, scale * fy, cx, cy, scale * skew), lens=lens)

    def undistort_pixels(
        self, pixels: Float[ndarray, "n 2"], straight: Intrinsics | None = None
    ) -> Float[ndarray, "n 2"]:
        """Where a pin-hole camera (`straight`, default this camera's own K) would see what these pixels show;
        NaN where it cannot.
        """
        frame = self.lens_frame or self.intrinsics
        seen = (straight or self.intrinsics).after(self.intrinsics, frame)

        def straighten(u, v):
            return np.stack(seen.pixel(*self.lens.chart.flat(*self.lens.unwarp(*frame.place(u, v)))), axis=-1)

        return in_blocks(straighten, pixels, width=2)

    def distort_pixels(
        self, pixels: Float[ndarray, "n 2"], straight: Intrinsics | None = None
    ) -> Float[ndarray, "n 2"]:
        """The inverse of `undistort_pixels`: where this camera sees what a pin-hole camera sees at these
        pixels.
        """
        return self.project(_in_front((straight or self.intrinsics).to_plane(pixels)))

    def undistort_map(
        self, straight: Intrinsics | None = None, size: tuple[int, int] | None = None
    ) -> tuple[Float[ndarray, "h w"], Float[ndarray, "h w"]]:
        """For each pixel of the straight image, where to look in the photograph: x and y, float32 as
        cv2.remap takes them.

        straight, size: intrinsics and (width, height) of the straight image, by default this camera's. NaN
        where a ray lies beyond the lens's domain or its image outside the photograph by more than a pixel, so
        that nothing folds back.
        """
        size, pin_hole = size or self.image_size, straight or self.intrinsics

        def sees_all_up_to(pixels):
            return self.lens.sees_all_up_to(self._lens_rays(_in_front(pin_hole.to_plane(pixels))))

        return smooth_map(
            lambda pixels: self.distort_pixels(pixels, pin_hole),
            size,
            vouched=sees_all_up_to,
            limits=self.image_size,
        )

    def straight_intrinsics(self, keep: str = "all", widest: float = WIDEST) -> Intrinsics:
        """A pin-hole for the straight image, same size: `all` keeps every photographed pixel, `valid` only
        places that were photographed.

        widest: no ray farther than this from the axis (radians) is kept, since a pin-hole stretches it
        without end. Raises InputError for another word. The paper: section 4.2, Fig. 7.
        """
        if keep not in ("all", "valid"):
            raise InputError(
                f"keep is {keep!r}; expected 'all' (every photographed pixel) or 'valid' (no black border)."
            )
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

    def _lens_rays(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Points of the camera frame as the lens meets them: turned about its own distortion centre where it
        has one.
        """
        if self.lens_frame is None:
            return points
        return points @ np.linalg.solve(self.lens_frame.matrix, self.intrinsics.matrix).T

    def _border_rays(self, border: ndarray, centre: ndarray, widest: float) -> ndarray:
        """Rays of the image's border; where a border pixel has none within `widest`, of the last pixel
        towards the centre that has.
        """
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
    return np.concatenate(
        [a + t[:, None] * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )


def _in_front(plane: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
    """Points at depth 1."""
    return np.concatenate([plane, np.ones((len(plane), 1))], axis=-1)


def _inner_rectangle(plane: ndarray, aspect: float) -> tuple[ndarray, ndarray]:
    """A large upright rectangle of the given aspect inside the closed curve `plane`, grown from the curve's
    middle.
    """
    middle = 0.5 * (plane.min(0) + plane.max(0))
    side = plane - middle
    # the curve meets the rectangle's boundary where max(|x| / aspect, |y|) is least
    half = np.maximum(np.abs(side[:, 0]) / aspect, np.abs(side[:, 1])).min()
    reach = np.array([half * aspect, half])
    return middle - reach, middle + reach
