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

Where photographs do not agree on one camera, the spread of their cameras is added to E^2, everywhere alike.
Headline figures are root mean squares over places: the *seen part*, at corners that were detected, and the
whole *frame*.  The region where the camera may be used (region.py) is as far as E stays below a limit between
corners. C. Hagemann, J. Knorr, H. Janssen and C. Stiller, Inferring bias and uncertainty in
camera calibration, IJCV 2022, and mrcal's documentation predict the like from corner noise alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orthoscope.evaluation.region import (
    MARGIN_SHARE,
    REGION_DIRECTIONS,
    REGION_STEPS,
    between,
    grown,
    inside,
    ways_from,
)
from orthoscope.evaluation.verdict.situation import FINE_PX
from orthoscope.fitting.slopes.image_slopes import difference_of_images, image_slopes, motion_slopes
from orthoscope.fitting.unseen.scatter import Scatter
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
# Areas are counted by so many parts of each cell along both sides.
CELL_PARTS = 5
# A camera that is nearer to a fit of which all is known than this share of the error is that fit's.
AS_GOOD_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class CameraError:
    """The predicted camera error, pixels per point.

    Attributes:
        seen_px, frame_px: root mean square over the seen part and over the frame, of what is far away.
        near_seen_px, near_frame_px: the same of things where the target was: over the seen part each corner
            at its own distance, since a shift of the camera undoes less where distances differ; over the
            frame at the typical one.
        model_px, alike_px, views_px, bias_px: over the seen part, far away, what makes it up: independent
            errors of corners alone; these with errors alike within a view and the priors' scatter; the
            jackknife over views with the priors' scatter; what a poorer model misses.
        distance: of the target, metres, in the typical view.
        far, near: (rows, columns) over the frame, row by row, at the cells' centres; NaN where the camera has
            no image.
        limit_px: where the error is larger the camera is not called good; the limit of the grades.
        region: (n,2) pixels, the polygon of the places where it is smaller and corners were seen around.
        share: of the frame, where the camera has an image, that lies in the region.
        seen_share: of it that lies between corners that were seen, however large the error.
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
    share: float
    seen_share: float
    without_px: Float[ndarray, " m"]

    def trusted(self, pixels: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
        """Which places of the image lie in the region where the camera may be used."""
        return inside(self.region, np.asarray(pixels, dtype=float))


class _Parts(NamedTuple):
    """A predicted error in all, and what makes it up, pixels."""

    total: float
    model: float
    alike: float
    views: float
    bias: float


class _Given(NamedTuple):
    """What is known of a calibration beside how its fit scatters: as `predicted_error` has it."""

    copies: float
    judged: Camera | None
    differ_px: float


class _Settled(NamedTuple):
    """How an image moves with a camera's d unknowns, a motion taken out: G - M U.

    Attributes:
        slopes: G, (n,2,d).
        motion: M, (n,2,c).
        undone: U, (c,d).
    """

    slopes: Float[ndarray, "n 2 d"]
    motion: Float[ndarray, "n 2 c"]
    undone: Float[ndarray, "c d"]

    def times(self, rows: Float[ndarray, "r d"]) -> Float[ndarray, "n 2 r"]:
        """The movements by changes of the unknowns."""
        return self.slopes @ rows.T - self.motion @ (self.undone @ rows.T)

    def spread(
        self, covariance: Float[ndarray, "d d"], unsettled: Float[ndarray, " n"]
    ) -> Float[ndarray, " n"]:
        """The variance of the image, both coordinates together.

        Args:
            unsettled: the same of G alone.
        """
        by_motion = covariance @ self.undone.T
        crossed = self.slopes @ by_motion - 0.5 * self.motion @ (self.undone @ by_motion)
        return np.maximum(unsettled - 2.0 * (crossed * self.motion).sum((1, 2)), 0.0)


class _Imaged:
    """A camera's scatter, and the slopes of its image of places by its unknowns, (n,2,d)."""

    def __init__(self, scatter: Scatter, rays: Float[ndarray, "n 3"]) -> None:
        self.scatter, self.repeated = scatter, scatter.repeated
        with np.errstate(invalid="ignore"):
            self.slopes = image_slopes(scatter.camera, rays, scatter.names)

    @cached_property
    def spread(self) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
        """The variance of the image by `repeated`, `alike` and `prior`, no motion taken out."""
        variances = np.zeros((3, len(self.slopes)))
        for along in self.slopes.transpose(1, 0, 2):
            # A displacement along x moves no pixel along y.
            moving = np.flatnonzero((np.abs(along) > 0.0).any(0))
            some, block = along[:, moving], np.ix_(moving, moving)
            for found, covariance in zip(
                variances, (self.repeated, self.scatter.alike, self.scatter.prior), strict=True
            ):
                found += ((some @ covariance[block]) * some).sum(1)
        return variances[0], variances[1], variances[2]

    def settled(self, rays: Float[ndarray, "m 3"], fitted: int, distance: float) -> _Settled:
        """The slopes at the first of the places, the motion taken out that undoes most over some of them.

        Args:
            rays: to these, of any lengths.
            fitted: how many of them the motion is fitted to.
        """
        slopes = self.slopes[: len(rays)]
        with np.errstate(invalid="ignore"):
            motion = motion_slopes(self.scatter.camera, rays, distance)
        undone = np.linalg.lstsq(
            motion[:fitted].reshape(2 * fitted, -1), slopes[:fitted].reshape(2 * fitted, -1), rcond=None
        )[0]
        return _Settled(slopes, motion, undone)


class _Variances:
    """E^2 and its parts at places along unit rays, a motion fitted out over the first of them."""

    def __init__(
        self,
        own: _Imaged,
        richer: _Imaged | None,
        poorer: _Imaged,
        rays: Float[ndarray, "n 3"],
        fitted: int,
        distance: float,
        given: _Given,
    ) -> None:
        # rays may have lengths of their own: places along them, in units of the distance
        settled, scatter = own.settled(rays, fitted, distance), own.scatter
        repeated, alike, prior = (variances[: len(rays)] for variances in own.spread)
        self.fitted = fitted
        self.model = settled.spread(own.repeated, repeated)[:fitted]
        self.alike = given.copies * settled.spread(scatter.alike, alike)
        by_view = settled.times(scatter.left_out)  # (n, 2, m)
        self.moved = (by_view**2).sum(1)  # (n, m)
        self.views = np.nansum(self.moved, axis=1) + settled.spread(scatter.prior, prior)
        draws = _effective_draws(np.nansum(self.moved[:fitted], axis=0))
        self.views = (draws * self.views + ALIKE_DRAWS * self.alike) / (draws + ALIKE_DRAWS)
        self.bias = np.zeros(len(rays))
        if richer is not None:
            of_rich, rich = richer.settled(rays, fitted, distance), richer.scatter
            if not scatter.stretch.any():  # a target that is taken for flat hides a stretch as well
                hidden = (of_rich.times(rich.stretch) ** 2).sum((1, 2))
                self.alike, self.views = self.alike + hidden, self.views + hidden
            apart = difference_of_images(
                rich.camera, poorer.scatter.camera, rays, rays[:fitted], distance=distance
            )
            if poorer is not own:
                by_view = poorer.settled(rays, fitted, distance).times(poorer.scatter.left_out)
            both = by_view - of_rich.times(rich.left_out)
            by_chance = np.nansum(both**2, axis=(1, 2))
            self.apart, self.by_chance = np.nan_to_num((apart**2).sum(1)), by_chance
            self.bias = np.maximum(self.apart - by_chance, 0.0)
        self.off, self.differ = np.zeros(len(rays)), given.differ_px**2
        if given.judged is not None and given.judged is not scatter.camera:
            off = difference_of_images(scatter.camera, given.judged, rays, rays[:fitted], distance=distance)
            self.off = np.nan_to_num((off**2).sum(1))
            if np.mean(self.off[:fitted]) < AS_GOOD_SHARE**2 * np.nanmean(self.total[:fitted]):
                self.off[:] = 0.0

    @property
    def total(self) -> Float[ndarray, " n"]:
        return np.maximum(self.alike, self.views) + self.bias + self.off + self.differ

    def over(self, some: slice) -> float:
        """The root mean square of the error over some places; the bias is what is left of it in the mean."""
        alike, views, bias = self._means(some)
        return float(np.sqrt(max(alike, views) + bias + self.differ))

    @property
    def parts(self) -> _Parts:
        """Root mean squares over the places that the motion was fitted to."""
        alike, views, bias = self._means(slice(self.fitted))
        squares = [max(alike, views) + bias + self.differ, float(np.nanmean(self.model)), alike, views, bias]
        return _Parts(*np.sqrt(squares).tolist())

    def _means(self, some: slice) -> tuple[float, float, float]:
        """Of both variances and of the squared bias, over some places."""
        bias = 0.0
        if self.bias.any():
            bias = max(float(np.nanmean(self.apart[some] - self.by_chance[some])), 0.0)
        bias += float(np.mean(self.off[some]))
        return float(np.nanmean(self.alike[some])), float(np.nanmean(self.views[some])), bias


def predicted_error(
    scatter: Scatter,
    seen: Float[ndarray, "s 2"],
    *,
    distance: float | Float[ndarray, " s"],
    richest: Scatter | None = None,
    poorer: Scatter | None = None,
    judged: Camera | None = None,
    corners: Float[ndarray, "n 2"] | None = None,
    copies: float = 1.0,
    differ_px: float = 0.0,
) -> CameraError:
    """The error that is to be expected of a camera.

    Args:
        scatter: of the camera.
        seen: pixels where corners were detected (`seen_places`).
        distance: of the corner that was seen there, metres; one for all where that will do.
        richest: scatter of the richest model of the same photographs, or of some of them; None where it is
            this one.
        poorer: scatter of the camera's own model of the photographs of the richest, where these are some.
        judged: the camera, where the scatter is that of another fit: how far it is from that one's counts as
            bias.
        corners: all that were detected, for the region to lie between; by default those of `seen`.
        copies: photographs for each that is no near-copy of another: what is said of errors within a view
            counted every one of them, though copies share their errors.
        differ_px: by how much the photographs' own cameras differ, rms.
    """
    camera = scatter.camera
    width, height = camera.image_size
    cells = _cells(width, height)
    rays, each = camera.unproject(seen), np.broadcast_to(np.asarray(distance, dtype=float), len(seen))
    known = np.isfinite(rays[:, 0])
    seen, rays, each = seen[known], rays[known], each[known]
    typical = median(each)
    middle = np.array([median(along) for along in seen.T])
    ways, given = ways_from(middle, camera.image_size), _Given(copies, judged, differ_px)
    places = np.concatenate([rays, camera.unproject(np.concatenate([cells, ways.reshape(-1, 2)]))])
    part_seen, part_frame = slice(len(seen)), slice(len(seen), len(seen) + len(cells))
    own, richer = _Imaged(scatter, places), richest and _Imaged(richest, places)
    other = _Imaged(poorer, places) if poorer and poorer is not scatter else own
    far = _Variances(own, richer, other, places, len(seen), np.inf, given)
    close = places[: part_frame.stop].copy()
    close[part_seen] *= each[:, None] / typical
    near = _Variances(own, richer, other, close, len(seen), typical, given)
    seen_px, model_px, alike_px, views_px, bias_px = far.parts
    along = np.sqrt(far.total[part_frame.stop :]).reshape(REGION_DIRECTIONS, REGION_STEPS)
    corners = seen if corners is None else corners
    margin = MARGIN_SHARE * max(width, height)
    region = grown(middle, ways, along, FINE_PX, seen=corners, margin=margin)
    imaged = _within_cells(np.isfinite(far.total[part_frame]), width, height)
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
        region=region,
        share=float(inside(region, imaged).mean()),
        seen_share=float(between(corners, imaged, margin).mean()),
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


def _effective_draws(squares: Float[ndarray, " m"]) -> float:
    """Of how many independent draws of one size a sum of squares is as sure (F. Satterthwaite, 1946).

    Args:
        squares: by each view left out; 0 where the others cannot tell.
    """
    return float(squares.sum() ** 2 / max((squares**2).sum(), 1e-300))


def _cells(width: int, height: int, parts: int = 1) -> Float[ndarray, "n 2"]:
    """Centres of the map's cells, row by row; of as many parts of each along both sides."""
    x = (np.arange(parts * MAP_COLUMNS) + 0.5) / (parts * MAP_COLUMNS) * width - 0.5
    y = (np.arange(parts * MAP_ROWS) + 0.5) / (parts * MAP_ROWS) * height - 0.5
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _within_cells(some: Bool[ndarray, " n"], width: int, height: int) -> Float[ndarray, "m 2"]:
    """Places within some of the map's cells, so many that shares of them are shares of area."""
    parts = np.ones((CELL_PARTS, CELL_PARTS), dtype=bool)
    return _cells(width, height, CELL_PARTS)[np.kron(some.reshape(MAP_ROWS, MAP_COLUMNS), parts).ravel()]
