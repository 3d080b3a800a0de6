"""How far off the camera is: predicted, in pixels, everywhere in the frame.

The *camera error* at a place is the distance in pixels between this camera's image of a direction and the
true camera's, a turn of the camera fitted out (a turn and a shift for things at the target's distance).
Nobody knows the true camera; what is predicted is the root mean square of that distance,

    E^2 = max(alike, views) + bias^2,    views = (n (jackknife + prior) + alike) / (n + 1),

the larger of two variances (scatter.py: errors alike within a view; views left out), the second of which few
views know so badly, as n independent draws, that the first counts for one more; and for a camera that
follows a formula, or takes its target for flat, its squared difference to the richest model beyond what
chance makes of it:

    bias^2 = max(0, |G (c - rich)|^2 - jackknife of the difference).

Headline figures are root mean squares over places: the *seen part*, at corners that were detected, and the
whole *frame*.  The region where the camera may be used is grown from the middle of the seen part as far as E
stays below a limit. C. Hagemann, J. Knorr, H. Janssen and C. Stiller, Inferring bias and uncertainty in
camera calibration, IJCV 2022, and mrcal's documentation predict the like from corner noise alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.verdict.situation import FINE_PX
from orthoscope.fitting.image_slopes import difference_of_images, image_slopes, motion_slopes
from orthoscope.fitting.scatter import Scatter
from orthoscope.geometry.arrays import Bool, Float, Int, evenly, median, ndarray
from orthoscope.models.camera import Camera

__all__ = ["CameraError", "picked", "predicted_error", "rms_difference", "seen_places"]

# So many corners stand for all that were seen.
PLACE_COUNT = 240
# Beside the jackknife, what errors alike within views say of the variance counts as so many draws.
ALIKE_DRAWS = 1.0
# The map has so many columns.
MAP_COLUMNS = 28
# The map has so many rows.
MAP_ROWS = 21
# The region is grown in so many directions.
REGION_DIRECTIONS = 48
# The region is grown in so many steps.
REGION_STEPS = 20


@dataclass(frozen=True, eq=False)
class CameraError:
    """The predicted camera error, pixels per point.

    Attributes:
        seen_px, frame_px: root mean square over the seen part and over the frame, of what is far away.
        near_seen_px, near_frame_px: the same of things where the target was: over the seen part each corner
            at its own distance, since a shift of the camera undoes less where distances differ; over the
            frame at the typical one.
        model_px, alike_px, views_px, bias_px: over the seen part, far away, what makes it up: independent
            errors of corners with the priors' scatter; these with errors alike within a view; the jackknife
            over views with the priors' scatter; what a poorer model misses.
        distance: of the target, metres, in the typical view.
        far, near: (rows, columns) over the frame, row by row, at the cells' centres; NaN where the camera has
            no image.
        limit_px: where the error is larger the camera is not called good; the limit of the grades.
        region: (n,2) pixels, the polygon of the places where it is smaller and corners were seen around.
        without_px: (m,) of each photograph, by how much the image over the seen part moves without it; NaN
            where the others cannot tell.
    """

    seen_px: float
    frame_px: float
    near_seen_px: float
    near_frame_px: float
    model_px: float
    alike_px: float
    views_px: float
    bias_px: float
    distance: float
    far: Float[ndarray, "rows columns"]
    near: Float[ndarray, "rows columns"]
    limit_px: float
    region: Float[ndarray, "n 2"]
    without_px: Float[ndarray, " m"]

    def trusted(self, pixels: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
        """Which places of the image lie in the region where the camera may be used."""
        return _inside(self.region, np.asarray(pixels, dtype=float))


class _Parts(NamedTuple):
    """A predicted error in all, and what makes it up, pixels."""

    total: float
    model: float
    alike: float
    views: float
    bias: float


class _Variances:
    """E^2 and its parts at places along unit rays, a motion fitted out over the first of them."""

    def __init__(
        self,
        scatter: Scatter,
        rich: Scatter | None,
        poorer: Scatter,
        rays: Float[ndarray, "n 3"],
        fitted: int,
        distance: float,
    ) -> None:
        # rays may have lengths of their own: places along them, in units of the distance
        slopes = _settled(scatter, rays, fitted, distance)
        self.fitted = fitted
        self.model, self.alike = _spread(slopes[:fitted], scatter.model), _spread(slopes, scatter.alike)
        by_view = slopes @ scatter.left_out.T  # (n, 2, m)
        self.moved = (by_view**2).sum(1)  # (n, m)
        self.views = np.nansum(self.moved, axis=1) + _spread(slopes, scatter.prior)
        draws = _effective_draws(np.nansum(self.moved[:fitted], axis=0))
        self.views = (draws * self.views + ALIKE_DRAWS * self.alike) / (draws + ALIKE_DRAWS)
        self.bias = np.zeros(len(rays))
        if rich is not None:
            of_rich = _settled(rich, rays, fitted, distance)
            if not scatter.stretch.any():  # a target that is taken for flat hides a stretch as well
                hidden = _spread(of_rich, rich.stretch)
                self.alike, self.views = self.alike + hidden, self.views + hidden
            apart = difference_of_images(rich.camera, poorer.camera, rays, rays[:fitted], distance=distance)
            if poorer is not scatter:
                by_view = _settled(poorer, rays, fitted, distance) @ poorer.left_out.T
            both = by_view - of_rich @ rich.left_out.T
            by_chance = np.nansum(both**2, axis=(1, 2))
            self.apart, self.by_chance = np.nan_to_num((apart**2).sum(1)), by_chance
            self.bias = np.maximum(self.apart - by_chance, 0.0)

    @property
    def total(self) -> Float[ndarray, " n"]:
        return np.maximum(self.alike, self.views) + self.bias

    def over(self, some: slice) -> float:
        """The root mean square of the error over some places; the bias is what is left of it in the mean."""
        alike, views, bias = self._means(some)
        return float(np.sqrt(max(alike, views) + bias))

    @property
    def parts(self) -> _Parts:
        """Root mean squares over the places that the motion was fitted to."""
        alike, views, bias = self._means(slice(self.fitted))
        squares = [max(alike, views) + bias, float(np.nanmean(self.model)), alike, views, bias]
        return _Parts(*np.sqrt(squares).tolist())

    def _means(self, some: slice) -> tuple[float, float, float]:
        """Of both variances and of the squared bias, over some places."""
        bias = 0.0
        if self.bias.any():
            bias = max(float(np.nanmean(self.apart[some] - self.by_chance[some])), 0.0)
        return float(np.nanmean(self.alike[some])), float(np.nanmean(self.views[some])), bias


def predicted_error(
    scatter: Scatter,
    seen: Float[ndarray, "s 2"],
    *,
    distance: float | Float[ndarray, " s"],
    richest: Scatter | None = None,
    poorer: Scatter | None = None,
) -> CameraError:
    """The error that is to be expected of a camera.

    Args:
        scatter: of the camera.
        seen: pixels where corners were detected (`seen_places`).
        distance: of the corner that was seen there, metres; one for all where that will do.
        richest: scatter of the richest model of the same photographs, or of some of them; None where it is
            this one.
        poorer: scatter of the camera's own model of the photographs of the richest, where these are some.
    """
    camera = scatter.camera
    width, height = camera.image_size
    cells = _cells(width, height)
    rays, each = camera.unproject(seen), np.broadcast_to(np.asarray(distance, dtype=float), len(seen))
    known = np.isfinite(rays[:, 0])
    seen, rays, each = seen[known], rays[known], each[known]
    typical = median(each)
    middle = np.array([median(along) for along in seen.T])
    ways = _ways(middle, width, height)
    places = np.concatenate([rays, camera.unproject(cells), camera.unproject(ways.reshape(-1, 2))])
    part_seen, part_frame = slice(len(seen)), slice(len(seen), len(seen) + len(cells))
    far = _Variances(scatter, richest, poorer or scatter, places, len(seen), np.inf)
    close = places[: part_frame.stop].copy()
    close[part_seen] *= each[:, None] / typical
    near = _Variances(scatter, richest, poorer or scatter, close, len(seen), typical)
    seen_px, model_px, alike_px, views_px, bias_px = far.parts
    along = np.sqrt(far.total[part_frame.stop :]).reshape(REGION_DIRECTIONS, REGION_STEPS)
    return CameraError(
        seen_px=seen_px,
        frame_px=far.over(part_frame),
        near_seen_px=near.over(part_seen),
        near_frame_px=near.over(part_frame),
        model_px=model_px,
        alike_px=alike_px,
        views_px=views_px,
        bias_px=bias_px,
        distance=typical,
        far=np.sqrt(far.total[part_frame]).reshape(MAP_ROWS, MAP_COLUMNS),
        near=np.sqrt(near.total[part_frame]).reshape(MAP_ROWS, MAP_COLUMNS),
        limit_px=FINE_PX,
        region=_grown(middle, ways, (along <= FINE_PX) & _between(seen, ways)),
        without_px=np.sqrt(far.moved[part_seen].mean(0)),
    )


def rms_difference(
    camera: Camera, true: Camera, seen: Float[ndarray, "s 2"], *, distance: float = np.inf
) -> float:
    """The camera error itself, where the true camera is known: rms pixels over the seen places.

    Args:
        seen: pixels of the true camera.
        distance: of what is looked at.
    """
    rays = true.unproject(seen)
    rays = rays[np.isfinite(rays[:, 0])]
    apart = difference_of_images(true, camera, rays, rays, distance=distance)
    return float(np.sqrt(np.nanmean((apart**2).sum(1))))


def seen_places(pixels: Float[ndarray, "n 2"]) -> Float[ndarray, "s 2"]:
    """Detected corners, evenly picked, that stand for all; the same whatever the order of the views."""
    return pixels[picked(pixels)]


def picked(pixels: Float[ndarray, "n 2"]) -> Int[ndarray, " s"]:
    """Which of the detected corners `seen_places` picks."""
    order = np.lexsort(pixels.T)
    return order[evenly(len(order), PLACE_COUNT)]


def _settled(
    scatter: Scatter, rays: Float[ndarray, "n 3"], fitted: int, distance: float
) -> Float[ndarray, "n 2 d"]:
    """Slopes of the image by the camera's unknowns, the motion taken out that undoes most over the first
    places.
    """
    with np.errstate(invalid="ignore"):
        slopes = image_slopes(scatter.camera, rays, scatter.names)
        motion = motion_slopes(scatter.camera, rays, distance)
    undone = np.linalg.lstsq(
        motion[:fitted].reshape(2 * fitted, -1), slopes[:fitted].reshape(2 * fitted, -1), rcond=None
    )[0]
    return slopes - motion @ undone


def _effective_draws(squares: Float[ndarray, " m"]) -> float:
    """Of how many independent draws of one size a sum of squares is as sure (F. Satterthwaite, 1946).

    Args:
        squares: by each view left out; 0 where the others cannot tell.
    """
    return float(squares.sum() ** 2 / max((squares**2).sum(), 1e-300))


def _spread(slopes: Float[ndarray, "n 2 d"], covariance: Float[ndarray, "d d"]) -> Float[ndarray, " n"]:
    """The variance of the image, both coordinates together."""
    return ((slopes @ covariance) * slopes).sum((1, 2))


def _cells(width: int, height: int) -> Float[ndarray, "n 2"]:
    """Centres of the map's cells, row by row."""
    x = (np.arange(MAP_COLUMNS) + 0.5) / MAP_COLUMNS * width - 0.5
    y = (np.arange(MAP_ROWS) + 0.5) / MAP_ROWS * height - 0.5
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _ways(middle: Float[ndarray, " 2"], width: int, height: int) -> Float[ndarray, "directions steps 2"]:
    """Pixels from the middle to the frame's border, in many directions."""
    angle = 2.0 * np.pi * np.arange(REGION_DIRECTIONS) / REGION_DIRECTIONS
    way = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    low, high = np.array([-0.5, -0.5]), np.array([width - 0.5, height - 0.5])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(way > 0, (high - middle) / way, (low - middle) / way)
    reach = np.where(np.abs(way) > 1e-12, reach, np.inf).min(1)
    share = np.arange(1, REGION_STEPS + 1) / REGION_STEPS
    return middle + reach[:, None, None] * share[:, None] * way[:, None]


def _grown(
    middle: Float[ndarray, " 2"], ways: ndarray, good: Bool[ndarray, "directions steps"]
) -> Float[ndarray, "n 2"]:
    """The polygon of the last place in each direction up to which all are good; the middle where none is."""
    reached = np.where(good.all(1), REGION_STEPS, np.argmin(good, axis=1))
    edge = ways[np.arange(len(ways)), np.maximum(reached - 1, 0)]
    return np.where(reached[:, None] > 0, edge, middle)


def _between(seen: Float[ndarray, "s 2"], ways: ndarray) -> Bool[ndarray, "directions steps"]:
    """Whether places lie in the convex hull of the seen ones: no farther out than they in any direction."""
    angle = 2.0 * np.pi * np.arange(REGION_DIRECTIONS) / REGION_DIRECTIONS
    outwards = np.stack([np.cos(angle), np.sin(angle)])
    return (ways @ outwards <= (seen @ outwards).max(0)).all(-1)


def _inside(polygon: Float[ndarray, "n 2"], pixels: Float[ndarray, "m 2"]) -> Bool[ndarray, " m"]:
    """Whether places lie within a polygon: how often a line from them to the right crosses its sides."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    x, y = pixels[:, :1], pixels[:, 1:]
    spans = (start[:, 1] > y) != (end[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = start[:, 0] + (y - start[:, 1]) * (end[:, 0] - start[:, 0]) / (end[:, 1] - start[:, 1])
    return (spans & (x < crossing)).sum(1) % 2 == 1
