"""Photographs of a target by a known camera: each pixel's ray goes back through the lens onto the sheet.

On the target's plane a place is (X, Y) in metres. The ray r of a pixel meets the plane at

    (X, Y, 1) mu = M r,    M^-1 = [R e_x   R e_y   t],    mu > 0 in front

and what the pixel then shows of the sheet is its mean over the pixel (`sheet.py`).

Then what a camera adds: uneven light, Gaussian blur, cos^4 vignetting, shot and read noise, whole grey
levels. Grey is linear in light.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, Int, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.table import Brown
from orthoscope.simulation.scene import Scene, random_views
from orthoscope.simulation.sheet import Sheet
from orthoscope.targets.target import Target, chessboard

__all__ = ["Renderer", "demo_scene", "render", "rendered_photographs"]

# So many rows are drawn at once, so that intermediate arrays stay small.
ROWS_AT_ONCE = 32
# Black ink has this grey level, before light, vignetting and noise.
BLACK_LEVEL = 15.0
# White paper has this grey level, before light, vignetting and noise.
WHITE_LEVEL = 200.0
# The background has this grey level, before light, vignetting and noise.
BACKGROUND_LEVEL = 90.0
# The background has so many waves along each side of the image.
WAVE_COUNT = 5
# The longest of the background's waves has so many grey levels.
TEXTURE_LEVELS = 40.0
# `noise` is meant at this grey level; half of its variance is read noise, half is shot noise.
MID_GREY_LEVEL = 128.0


@dataclass(frozen=True, eq=False)
class Renderer:
    """A camera ready to photograph: what is the same in every photograph is computed once.

    Attributes:
        camera: which takes them.
        oversampling: sub-samples along a pixel's side where an edge crosses it.
        blur_px: sigma of the blur, pixels.
        vignetting: share of the light that the farthest corner loses.
        noise: standard deviation at mid-grey, grey levels.
        light: how much brighter one side is lit than the other, as a share.
    Raises:
        InputError: values out of range.
    """

    camera: Camera
    oversampling: int = 4
    blur_px: float = 0.7
    vignetting: float = 0.3
    noise: float = 2.0
    light: float = 0.2

    def __post_init__(self) -> None:
        if self.oversampling < 1:
            raise InputError(f"oversampling is {self.oversampling}; expected 1 or more.")
        if not 0 <= self.vignetting < 1:
            raise InputError(
                f"vignetting is {self.vignetting}; expected a share of the light, 0 or more and below 1."
            )
        for name in ("blur_px", "noise", "light"):
            if not 0 <= getattr(self, name) < np.inf:
                raise InputError(f"{name} is {getattr(self, name)}; expected 0 or more.")

    def photograph(
        self, target: Target, camera_from_target: Pose, *, rng: np.random.Generator | None = None
    ) -> ndarray:
        """One photograph, (h,w) uint8; black where a pixel has no ray.

        Args:
            target: what it shows.
            camera_from_target: where that stands.
            rng: where background, light and noise come from; without it the background is plain, the light
                even and there is no noise.
        Raises:
            InputError: the target cannot be drawn.
        """
        return self.photograph_of([(target, camera_from_target)], rng=rng)

    def photograph_of(
        self,
        stands: Sequence[tuple[Target, Pose]],
        *,
        rng: np.random.Generator | None = None,
        behind: ndarray | None = None,
    ) -> ndarray:
        """One photograph of several targets, (h,w) uint8.

        Args:
            stands: each target and camera_from_target, the one in front last.
            rng: as in `photograph`.
            behind: what is seen around the targets, (h,w) grey levels, instead of a background of its own.
        Raises:
            InputError: a target cannot be drawn; `behind` has another size.
        """
        image = self._background(rng, behind)
        for target, camera_from_target in stands:
            sheet = Sheet(target.drawing(), black=BLACK_LEVEL, white=WHITE_LEVEL)
            plane_from_ray = _plane_from_ray(camera_from_target)
            for start in range(0, len(image), ROWS_AT_ONCE):
                self._draw(sheet, plane_from_ray, image, start)
        if rng is not None:
            image *= self._lighting(rng)
        image *= self._valid
        image = _blurred(image, self.blur_px) * self._falloff
        if rng is not None and self.noise > 0:
            image += self._noise(image, rng)
        return np.rint(np.clip(image, 0.0, 255.0) * self._valid).astype(np.uint8)

    def _background(self, rng: np.random.Generator | None, behind: ndarray | None) -> Float[ndarray, "h w"]:
        if behind is None:
            if rng is not None:
                return self._surroundings(rng)
            return np.full(self._valid.shape, BACKGROUND_LEVEL, dtype=np.float32)
        if behind.shape != self._valid.shape:
            raise InputError(
                f"behind has shape {behind.shape}; expected the picture's {self._valid.shape}: resize it."
            )
        return behind.astype(np.float32)

    @cached_property
    def _rays(self) -> Float[ndarray, "3 h w"]:
        """The ray of each pixel; single precision is 6e-8 radians, far below a thousandth of a pixel."""
        width, height = self.camera.image_size
        rays = np.empty((3, height, width), dtype=np.float32)
        for start in range(0, height, ROWS_AT_ONCE):
            stop = min(start + ROWS_AT_ONCE, height)
            y, x = np.mgrid[start:stop, 0:width].astype(float).reshape(2, -1)
            rays[:, start:stop] = self.camera.unproject(np.stack([x, y], axis=-1)).T.reshape(
                3, stop - start, width
            )
        return rays

    @cached_property
    def _valid(self) -> ndarray:
        """Which pixels (h,w) have a ray."""
        return np.isfinite(self._rays[2])

    @cached_property
    def _falloff(self) -> Float[ndarray, "h w"]:
        """cos^4 of an angle that grows with the distance from the principal point, so that the farthest
        corner loses `vignetting`.
        """
        x, y = self._grid()
        square = (x - self.camera.intrinsics.cx) ** 2 + (y - self.camera.intrinsics.cy) ** 2
        angle = np.arccos((1.0 - self.vignetting) ** 0.25) * np.sqrt(square / square.max())
        return np.cos(angle, dtype=np.float32) ** 4

    def _grid(self) -> tuple[Float[ndarray, "1 w"], Float[ndarray, "h 1"]]:
        width, height = self.camera.image_size
        return np.arange(width, dtype=np.float32)[None], np.arange(height, dtype=np.float32)[:, None]

    def _surroundings(self, rng: np.random.Generator) -> Float[ndarray, "h w"]:
        """What is behind the board: a sum of cosines, the long ones strongest."""
        (x, y), (width, height) = self._grid(), self.camera.image_size
        wave = np.arange(WAVE_COUNT, dtype=np.float32)
        strength = (
            TEXTURE_LEVELS
            * rng.standard_normal((WAVE_COUNT, WAVE_COUNT), dtype=np.float32)
            / (1.0 + wave[:, None] ** 2 + wave**2)
        )
        along_x, along_y = np.cos(np.pi * wave[:, None] * (x / width)), np.cos(np.pi * wave * (y / height))
        return np.clip(BACKGROUND_LEVEL + along_y @ strength @ along_x, BLACK_LEVEL, WHITE_LEVEL)

    def _lighting(self, rng: np.random.Generator) -> Float[ndarray, "h w"]:
        """Light that is stronger on one side of the image, from a random direction; 1 in the middle."""
        (x, y), (width, height) = self._grid(), self.camera.image_size
        phi = float(rng.uniform(-np.pi, np.pi))
        return 1.0 + self.light * (
            float(np.cos(phi)) * (x / width - 0.5) + float(np.sin(phi)) * (y / height - 0.5)
        )

    def _noise(self, image: ndarray, rng: np.random.Generator) -> Float[ndarray, "h w"]:
        sigma = self.noise * np.sqrt(0.5 + 0.5 * np.maximum(image, 0.0) / MID_GREY_LEVEL)
        return sigma * rng.standard_normal(image.shape, dtype=np.float32)

    def _draw(self, sheet: Sheet, plane_from_ray: ndarray, image: ndarray, start: int) -> None:
        """Draw the sheet over ROWS rows of the image."""
        stop, (height, width) = min(start + ROWS_AT_ONCE, len(image)), image.shape
        first = max(start - 1, 0)  # one row more on either side, for the slopes
        rays = self._rays[:, first : min(stop + 1, height)]
        plane = plane_from_ray @ rays.reshape(3, -1)
        plane = plane[:2] / np.where(plane[2] > 0, plane[2], np.nan)
        mine = plane[:, (start - first) * width :][:, : (stop - start) * width]
        on_sheet = np.flatnonzero(sheet.near(*mine))
        if len(on_sheet):
            slopes = _slopes(plane.reshape(2, -1, width), on_sheet + (start - first) * width)
            cover, grey = sheet.look(mine[:, on_sheet], slopes, self.oversampling)
            block = image[start:stop].reshape(-1)
            block[on_sheet] = block[on_sheet] * (1.0 - cover) + grey


def render(
    camera: Camera,
    target: Target,
    camera_from_target: Pose,
    *,
    rng: np.random.Generator | None = None,
    oversampling: int = 4,
    blur_px: float = 0.7,
    vignetting: float = 0.3,
    noise: float = 2.0,
    light: float = 0.2,
) -> ndarray:
    """One photograph (h,w) uint8 of a target; many of one camera are quicker from one `Renderer`, which
    explains the settings.
    """
    renderer = Renderer(
        camera, oversampling=oversampling, blur_px=blur_px, vignetting=vignetting, noise=noise, light=light
    )
    return renderer.photograph(target, camera_from_target, rng=rng)


def rendered_photographs(
    scene: Scene, *, rng: np.random.Generator, renderer: Renderer | None = None
) -> Iterator[tuple[str, ndarray]]:
    """Name and photograph (h,w) uint8 of each view of a scene, one after the other; renderer: by default with
    its own defaults.
    """
    renderer = renderer or Renderer(scene.camera)
    for image, pose in zip(scene.images, scene.camera_from_target, strict=True):
        yield image, renderer.photograph(scene.target, pose, rng=rng)


def demo_scene(*, seed: int = 0, count: int = 20) -> Scene:
    """The scene of `orthoscope demo`: a 1280x960 camera whose straight lines are visibly bent, and a
    chessboard that fits a sheet of A4.

    Every view has the outer squares in the image, which detectors need. Many squares, hardly rolled, bring
    corners near the image's own, where a recovered camera is least sure.
    """
    lens = Brown(k1=-0.31, k2=0.13, p1=0.0011, p2=-0.0007, k3=-0.025)
    camera = Camera((1280, 960), Intrinsics(905.0, 902.0, 652.0, 467.0), lens)
    square = 0.016
    target = chessboard(14, 9, square)
    views = random_views(
        camera,
        target,
        count,
        rng=np.random.default_rng(seed),
        roll=(-0.2, 0.2),
        fill=(0.45, 0.95),
        margin=square,
    )
    return Scene(camera, target, views)


def _plane_from_ray(camera_from_target: Pose) -> Float[ndarray, "3 3"]:
    """M of the module's docstring, up to a positive factor; zeros for a board seen exactly edge on."""
    right, down, _ = camera_from_target.rotation.T
    corner = camera_from_target.translation
    adjugate = np.stack([np.cross(down, corner), np.cross(corner, right), np.cross(right, down)])
    return adjugate * np.sign(adjugate[2] @ corner)


def _slopes(plane: Float[ndarray, "2 h w"], index: Int[ndarray, " n"]) -> Float[ndarray, "2 2 n"]:
    """d plane / d pixel at flat indices, [i, j] of coordinate i along x or y, by differences; tiny where a
    neighbour has no place.
    """
    height, width = plane.shape[1:]
    row, column = np.divmod(index, width)
    left, right = np.maximum(column - 1, 0), np.minimum(column + 1, width - 1)
    above, below = np.maximum(row - 1, 0), np.minimum(row + 1, height - 1)
    flat = plane.reshape(2, -1)
    along_x = (flat.take(index - column + right, axis=1) - flat.take(index - column + left, axis=1)) / (
        right - left
    )
    along_y = (flat.take(below * width + column, axis=1) - flat.take(above * width + column, axis=1)) / (
        below - above
    )
    return np.nan_to_num(np.stack([along_x, along_y], axis=1), nan=1e-6)


def _blurred(image: Float[ndarray, "h w"], sigma: float) -> Float[ndarray, "h w"]:
    """Gaussian blur, sigma in pixels, the image continued by its border."""
    radius = int(np.ceil(4.0 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / max(sigma, 1e-9)) ** 2)
    for _ in range(2):  # along the columns, then turned, along the rows
        padded = np.pad(image, ((radius, radius), (0, 0)), mode="edge")
        blurred = np.zeros_like(image)
        for i, weight in enumerate(kernel / kernel.sum()):
            blurred += np.float32(weight) * padded[i : i + len(image)]
        image = blurred.T
    return image
