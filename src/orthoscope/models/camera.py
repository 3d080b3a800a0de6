"""The camera: pin-hole and lens, and the maps that straighten photographs.

A point becomes a ray, a place in the lens's chart, a distorted place, a pixel (docs/conventions.md). With
a lens frame L the ray is turned by L^-1 K first and L takes the place of K at the end: the lens then acts
about its own distortion centre.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from orthoscope.geometry.arrays import Bool, Float, InputError, ndarray
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.chunks import in_chunks
from orthoscope.models.lenses.decentred import Brown
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.opencv_order import opencv_distortion
from orthoscope.models.parameters import Parameters
from orthoscope.models.pixel_slopes import PixelSlopes
from orthoscope.models.smooth_map import smooth_map

__all__ = ["LARGEST_SIDE", "WIDEST_ANGLE", "Camera", "image_border"]

# The lens of a camera without any.
PIN_HOLE = Brown()
# A straight view of `valid` places keeps this far inside the photograph, pixels: an interpolation rounds.
EDGE_PX = 1e-3
# The scale of a straight view is found by so many halvings.
BISECTION_STEPS = 14
# Another middle of a straight view must be better by this share.
GAIN_SHARE = 1e-3
# The last pixel with a ray is found to this share of its distance from the middle.
BORDER_SHARE = 1e-6
# No image has a side of more pixels; a file that says so is damaged.
LARGEST_SIDE = 1_000_000
# Rays farther from the axis than this, radians, a pin-hole stretches without end.
WIDEST_ANGLE = np.deg2rad(75.0)


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera.

    Attributes:
        image_size: (width, height).
        lens_frame: intrinsics of the lens's own plane where its distortion centre is not the principal point;
            None means the intrinsics themselves.
    Raises:
        InputError: an image without size.
    """

    image_size: tuple[int, int]
    intrinsics: Intrinsics
    lens: Lens
    lens_frame: Intrinsics | None = None

    def __post_init__(self) -> None:
        width, height = (int(side) for side in self.image_size)
        if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
            raise InputError(
                f"image_size is {self.image_size}; expected (width, height), 1 to {LARGEST_SIDE} pixels each."
            )
        object.__setattr__(self, "image_size", (width, height))

    def __repr__(self) -> str:
        (width, height), (fx, fy, cx, cy, skew) = self.image_size, self.intrinsics.as_tuple()
        pin_hole = f"fx {fx:.6g} fy {fy:.6g} cx {cx:.6g} cy {cy:.6g}" + (f" skew {skew:.3g}" if skew else "")
        centre = f" about ({self.lens_frame.cx:.6g}, {self.lens_frame.cy:.6g})" if self.lens_frame else ""
        return f"Camera({width}x{height}, {pin_hole}, {self.lens!r}{centre})"

    @property
    def K(self) -> Float[ndarray, "3 3"]:
        """The pin-hole's matrix, [fx skew cx; 0 fy cy; 0 0 1], pixels."""
        return self.intrinsics.matrix

    def opencv(self) -> tuple[Float[ndarray, "3 3"], Float[ndarray, " k"]]:
        """K and distortion as OpenCV takes them, of cv2 for brown and rational, of cv2.fisheye else.

        Raises:
            InputError: OpenCV has no such lens, no skew, or no distortion centre of its own.
        """
        if self.intrinsics.skew or self.lens_frame is not None:
            what = "distortion centre of its own" if self.lens_frame else "skew"
            raise InputError(f"OpenCV has no {what}, and this camera has one. Calibrate without it.")
        return self.K, np.array(opencv_distortion(self.lens))

    def linearise(self, points: Iterable[ndarray], free: Parameters | Iterable[str] = ()) -> PixelSlopes:
        """Pixels of points and their slopes by point and parameter; the formula goes on beyond its domain.

        Args:
            points: X, Y and Z in the camera frame, arrays of one shape, any unit.
            free: parameters whose slopes are wanted, as models/parameters.py names them.
        """
        return PixelSlopes(self, points, Parameters.of(free))

    def project(self, points: ArrayLike, *, beyond: bool = False) -> ndarray:
        """Pixels of points in the camera frame; NaN where the lens gives them no image.

        Args:
            points: (n,3), or (3,) for one; any unit.
            beyond: let the formula go on where the lens's domain has ended, as least squares does; such
                pixels are no images.

        Returns:
            (n,2), or (2,) for one.

        Raises:
            InputError: the points have another shape.
        """
        points = _rows(points, 3, "points")
        frame = self.lens_frame or self.intrinsics
        pixels = frame.to_pixels(self.lens.distort(self._lens_rays(np.atleast_2d(points)), beyond=beyond))
        return pixels if points.ndim == 2 else pixels[0]

    def unproject(self, pixels: ArrayLike) -> ndarray:
        """Unit rays, camera frame, that fall on pixels; NaN where none does.

        Args:
            pixels: (n,2), or (2,) for one.

        Returns:
            (n,3), or (3,) for one.

        Raises:
            InputError: the pixels have another shape.
        """
        pixels = _rows(pixels, 2, "pixels")
        rays = self._rays(np.atleast_2d(pixels))
        return rays if pixels.ndim == 2 else rays[0]

    def _rays(self, pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit rays of pixels."""
        frame = self.lens_frame or self.intrinsics
        rays = in_chunks(
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

    def resized(self, size: tuple[int, int]) -> Camera:
        """The same camera where its photographs are scaled to another size, a pixel's corner to a pixel's
        corner.

        Args:
            size: (width, height) of the new photographs; the same shape or not.
        Raises:
            InputError: a side is less than 1.
        """
        width, height = self._checked_size(size)
        across, down = width / self.image_size[0], height / self.image_size[1]
        return self._with_frame(
            (width, height),
            lambda k: Intrinsics(
                across * k.fx,
                down * k.fy,
                across * (k.cx + 0.5) - 0.5,
                down * (k.cy + 0.5) - 0.5,
                across * k.skew,
            ),
        )

    def cropped(self, left: int, top: int, size: tuple[int, int]) -> Camera:
        """The same camera where its photographs are cut to a part of them.

        Args:
            left, top: the part's first pixel, in pixels of this camera.
            size: (width, height) of the part.
        Raises:
            InputError: the part is not within the image.
        """
        width, height = self._checked_size(size)
        if left < 0 or top < 0 or left + width > self.image_size[0] or top + height > self.image_size[1]:
            raise InputError(
                f"a part of {width}x{height} from pixel ({left}, {top}) is not within an image of"
                f" {self.image_size[0]}x{self.image_size[1]}. Choose a part of the image."
            )
        return self._with_frame((width, height), lambda k: replace(k, cx=k.cx - left, cy=k.cy - top))

    def binned(self, factor: int) -> Camera:
        """The same camera where each block of factor x factor pixels is read as one; what is left over is cut
        off.

        Args:
            factor: 2 or more; 1 changes nothing.
        Raises:
            InputError: the factor is less than 1 or larger than the image.
        """
        if factor < 1 or factor > min(self.image_size):
            raise InputError(
                f"binning by {factor} is not possible; expected 1 to {min(self.image_size)} pixels a block."
            )
        width, height = self.image_size[0] // factor, self.image_size[1] // factor
        return self.cropped(0, 0, (width * factor, height * factor)).resized((width, height))

    @staticmethod
    def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
        width, height = (int(side) for side in size)
        if width < 1 or height < 1:
            raise InputError(f"the size is {width}x{height}; expected (width, height) of at least 1 pixel.")
        return width, height

    def _with_frame(self, size: tuple[int, int], moved: Callable[[Intrinsics], Intrinsics]) -> Camera:
        """The camera of another size, its pixels moved."""
        frame = self.lens_frame and moved(self.lens_frame)
        return Camera(size, moved(self.intrinsics), self.lens, frame)

    def undistort_pixels(
        self, pixels: Float[ndarray, "n 2"], straight: Intrinsics | None = None
    ) -> Float[ndarray, "n 2"]:
        """Where a pin-hole camera (`straight`, default this camera's own K) would see what these pixels show;
        NaN where it cannot.
        """
        frame = self.lens_frame or self.intrinsics
        seen = (straight or self.intrinsics).after(self.intrinsics, frame)

        def straighten(u: ndarray, v: ndarray) -> ndarray:
            return np.stack(seen.pixel(*self.lens.chart.flat(*self.lens.unwarp(*frame.place(u, v)))), axis=-1)

        return in_chunks(straighten, pixels, width=2)

    def distort_pixels(
        self, pixels: Float[ndarray, "n 2"], straight: Intrinsics | None = None
    ) -> Float[ndarray, "n 2"]:
        """The inverse of `undistort_pixels`: where this camera sees what a pin-hole camera sees at these
        pixels.
        """
        return self.project(_in_front((straight or self.intrinsics).to_plane(pixels)))

    def view_map(self, view: Camera) -> tuple[Float[ndarray, "h w"], Float[ndarray, "h w"]]:
        """For each pixel of another camera at the same place, where to look in this one's photograph.

        Args:
            view: the other camera, such as one of a straight picture; its lens may be any.
        Returns:
            x and y, float32 as cv2.remap takes them; NaN where a ray lies beyond either lens's domain or its
            image outside the photograph by more than a pixel.
        """
        if isinstance(view.lens, type(PIN_HOLE)) and not view.lens.coefficients.any() and not view.lens_frame:
            return self.undistort_map(view.intrinsics, view.image_size)
        return smooth_map(
            lambda pixels: self.project(view.unproject(pixels)),
            view.image_size,
            vouched=lambda pixels: np.zeros(len(pixels), dtype=bool),
            limits=self.image_size,
        )

    def undistort_map(
        self, straight: Intrinsics | None = None, size: tuple[int, int] | None = None
    ) -> tuple[Float[ndarray, "h w"], Float[ndarray, "h w"]]:
        """For each pixel of the straight image, where to look in the photograph: x and y, float32 as
        cv2.remap takes them.

        NaN where a ray lies beyond the lens's domain or its image outside the photograph by more than a
        pixel, so that nothing folds back.

        Args:
            straight, size: intrinsics and (width, height) of the straight image, by default this camera's.
        """
        size, pin_hole = size or self.image_size, straight or self.intrinsics

        def sees_all_up_to(pixels: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
            return self.lens.sees_all_up_to(self._lens_rays(_in_front(pin_hole.to_plane(pixels))))

        return smooth_map(
            lambda pixels: self.distort_pixels(pixels, pin_hole),
            size,
            vouched=sees_all_up_to,
            limits=self.image_size,
        )

    def straight_intrinsics(
        self, keep: str = "all", widest: float = WIDEST_ANGLE, size: tuple[int, int] | None = None
    ) -> Intrinsics:
        """A pin-hole for the straight image, with this camera's aspect, so that squares stay squares.

        Args:
            keep: `all` keeps every photographed pixel, `valid` only places that were photographed.
            widest: no ray farther than this from the axis (radians) is kept, since a pin-hole stretches it
                without end.
            size: (width, height) of the straight image; by default this camera's.
        Raises:
            InputError: another word.
        Source:
            The paper, section 4.2, Fig. 7.
        """
        if keep not in ("all", "valid"):
            raise InputError(
                f"keep is {keep!r}; expected 'all' (every photographed pixel) or 'valid' (no black border)."
            )
        reach = np.array(size or self.image_size) - 1.0
        aspect = np.array([self.intrinsics.fx, self.intrinsics.fy])
        centre = np.array([[self.intrinsics.cx, self.intrinsics.cy]])
        rays = self._border_rays(image_border(self.image_size), centre, widest)
        plane = rays[:, :2] / rays[:, 2:] * aspect
        low, high = plane.min(0), plane.max(0)
        middle, scale = 0.5 * (low + high), float((reach / (high - low)).min())
        if keep == "valid":
            middle, scale = self._inner_view(middle, scale, size or self.image_size, np.tan(widest))
        (fx, fy), (cx, cy) = scale * aspect, 0.5 * reach - scale * middle
        return Intrinsics(float(fx), float(fy), float(cx), float(cy))

    def _inner_view(
        self, middle: ndarray, scale: float, size: tuple[int, int], farthest: float
    ) -> tuple[ndarray, float]:
        """Middle and scale of the largest straight view that shows nothing but what was photographed.

        Args:
            middle: in pixels of this camera's own pin-hole, from its principal point; where to start.
            scale: at which more than what was photographed is shown.
            size: (width, height) of the view.
            farthest: tangent of the largest angle from the axis.
        """
        aspect = np.array([self.intrinsics.fx, self.intrinsics.fy])
        reach, limits = np.array(size) - 1.0, np.array(self.image_size) - 1.0

        def fits(middle: ndarray, scale: float, pixels: ndarray) -> bool:
            plane = ((pixels - 0.5 * reach) / scale + middle) / aspect
            if (plane * plane).sum(1).max() > farthest * farthest:
                return False
            seen = self.project(_in_front(plane))
            return bool(((seen >= EDGE_PX) & (seen <= limits - EDGE_PX)).all())  # NaN fits nowhere

        def least(middle: ndarray, low: float, high: float, pixels: ndarray) -> float:
            for _ in range(BISECTION_STEPS):
                if fits(middle, between := np.sqrt(low * high), pixels):
                    high = between
                else:
                    low = between
            return float(high)

        few, every = image_border(size), image_border(size, max(size))
        start = min(scale, 1.0)
        largest = next((start * 2.0**i for i in range(1, 16) if fits(middle, start * 2.0**i, few)), None)
        if largest is None:  # the middle itself was not photographed: the principal point is the better one
            middle = np.zeros(2)
            largest = next((start * 2.0**i for i in range(1, 24) if fits(middle, start * 2.0**i, few)), None)
        if largest is None:
            raise InputError("no part of the image can be shown straight. Use keep='all'.")
        scale = least(middle, 0.5 * start, largest, few)
        for step in (0.08, 0.04, 0.02, 0.01):
            for side in (*np.diag(reach), *-np.diag(reach)):
                moved = middle + step * side / scale
                while fits(moved, scale * (1.0 - GAIN_SHARE), few):
                    middle, scale = moved, least(moved, 0.5 * scale, scale * (1.0 - GAIN_SHARE), few)
                    moved = middle + step * side / scale
        while not fits(middle, scale, every):
            scale *= 1.0 + GAIN_SHARE
        return middle, scale

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
        rays = self.unproject(border)
        lost = np.flatnonzero(~(rays[:, 2] >= np.cos(widest)))
        inside, outside, line = np.zeros((len(lost), 1)), np.ones((len(lost), 1)), border[lost] - centre
        while len(lost) and (outside - inside).max() >= BORDER_SHARE:
            middle = 0.5 * (inside + outside)
            reached = self.unproject(centre + middle * line)[:, 2:] >= np.cos(widest)
            inside, outside = np.where(reached, middle, inside), np.where(reached, outside, middle)
        rays[lost] = self.unproject(centre + inside * line)
        return rays


def image_border(image_size: tuple[int, int], samples: int = 64) -> Float[ndarray, "n 2"]:
    """Pixels along the four sides of an image, clockwise from the top left, each corner once."""
    right, bottom = image_size[0] - 1.0, image_size[1] - 1.0
    t = np.arange(samples) / samples
    corners = np.array([[0, 0], [right, 0], [right, bottom], [0, bottom]])
    return np.concatenate(
        [a + t[:, None] * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )


def _rows(values: ArrayLike, width: int, name: str) -> ndarray:
    """An array of rows of a width, or one such row; as it is where it is one already."""
    array = values if isinstance(values, ndarray) and values.dtype == np.float64 else _numbers(values, name)
    if array.ndim not in (1, 2) or array.shape[-1] != width:
        raise InputError(f"{name} have shape {array.shape}; expected (n, {width}), or ({width},) for one.")
    return array


def _numbers(values: ArrayLike, name: str) -> ndarray:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} are not numbers ({error}); expected rows of them.") from error


def _in_front(plane: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
    """Points at depth 1."""
    return np.concatenate([plane, np.ones((len(plane), 1))], axis=-1)
