"""Corners and whole views that do not belong: found, named with the reason, left out before a calibration.

Three steps, each more exact than the one before and started by it.

1. *Order*. In each view a robust polynomial over the target says where each corner should be, whatever the
   lens (view_polynomial.py). A view whose typical corner misses that by more than DISORDER_SHARE of a square
   is in no order of the target and is set aside. Corners that miss by more than FAR_OFF_RATIO take no part in
   the next step's start; nothing is decided about them yet, since a strong lens is no polynomial.
2. *Camera*. FCCM of the others with a Cauchy loss, then on with all corners, the loss's scale being
   OUTLYING_RATIO times the noise that the views tell. The scale is wide on purpose: a narrow one gives up the
   border of the image where the lens formula fits badly, and the corners there would then look wrong.
3. *Residuals* (residual_tests.py). What is off by far more than the noise, and for no reason that repeats, is
   left out; 2 and 3 are done again until nothing changes.

M. Fischler and R. Bolles' RANSAC (CACM 24, 1981) would do step 1 by chance; here the same photographs always
give the same answer.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.observations import Observations, Poses
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.fitting.usable_views import with_usable_views
from orthoscope.geometry.arrays import Bool, CalibrationError, Float, Int, median, ndarray
from orthoscope.methods.fccm import fit_flat
from orthoscope.methods.outliers.residual_tests import (
    LEAST_HARM,
    OUTLYING_RATIO,
    Believed,
    noise_of,
    residual_tests,
    sizes_of,
)
from orthoscope.methods.outliers.view_polynomial import trends
from orthoscope.solve.least_squares import Options, solve
from orthoscope.solve.losses import Cauchy
from orthoscope.targets.detections import Detections, Outlier, SetAside, View

__all__ = ["without_outliers"]

# A view whose typical corner misses the polynomial by more than this share of a square is in disorder: a
# right board seen through a fisheye misses it by 0.3 at most, one in another order by 0.5 to 20.
DISORDER_SHARE = 0.4
# It also has to miss by this many times what the typical view does, or by a whole square: where all are as
# bad, none is in disorder.
DISORDER_RATIO = 3.0
# A corner is far off that misses by this many times what its view typically does, and by half a square.
FAR_OFF_RATIO = 4.0
# Where no camera fits, views with more than this share of their corners far off are given up first.
DOUBTFUL_SHARE = 0.25
# The loss of the start forgives from this share of the image's longer side on.
START_LOSS_SHARE = 0.002
# Steps 2 and 3 are done at most this often.
REFINING_ROUNDS = 4
# A refined camera need not be exact, since the next round moves it again.
ROUGH_OPTIONS = Options(max_steps=20, tolerance=1e-4)


class _Order(NamedTuple):
    """Step 1: what the order of the corners says, a row each view.

    Attributes:
        near: corners near where the others of their view put them, (m,n).
        typical: the view's median miss, (m,) pixels.
        disorder: whether the view is in no order of the target, (m,).
    """

    near: Bool[ndarray, "m n"]
    typical: Float[ndarray, " m"]
    disorder: Bool[ndarray, " m"]


def without_outliers(detections: Detections, *, lens: str = "auto") -> Detections:
    """The detections with corners that do not belong in `outliers`, views that do not in `set_aside`.

    Args:
        detections: what was found.
        lens: of the cameras that decide, as in `fccm`.
    Raises:
        CalibrationError: no view is left, or the corners fit no camera with this lens.
    """
    used = with_usable_views(detections)
    points = used.target.points
    observations = Observations.of(used)
    order = _order(observations, points)
    aside = {
        int(observations.order[row]): (
            f"half of its corners are {order.typical[row]:.0f} px or more from where the others put them: "
            "they are not in the target's order"
        )
        for row in np.flatnonzero(order.disorder)
    }
    believed, given_up = _started(used, observations, order, lens=lens)
    believed, strange = _settled(believed, points)
    return _parted(used, believed, sizes_of(believed, points), aside | given_up | strange)


def _order(observations: Observations, points: Float[ndarray, "p 3"]) -> _Order:
    """Step 1: which corners are near and which views are in disorder."""
    present = observations.present
    trend = trends(points[observations.ids, :2], observations.pixels(), present, order=3)
    square = _squares(trend.values, present)
    share = trend.typical / square
    near = (present > 0) & (trend.misses <= np.maximum(FAR_OFF_RATIO * trend.typical, 0.5 * square)[:, None])
    return _Order(near, trend.typical, share > min(max(DISORDER_SHARE, DISORDER_RATIO * median(share)), 1.0))


def _squares(places: Float[ndarray, "m n 2"], present: Float[ndarray, "m n"]) -> Float[ndarray, " m"]:
    """The side of the square that each corner of a view has to itself in the image, pixels."""
    seen = present[..., None] > 0
    spans = np.where(seen, places, -np.inf).max(1) - np.where(seen, places, np.inf).min(1)
    return np.sqrt(spans.prod(1) / present.sum(1))


def _started(
    used: Detections, observations: Observations, order: _Order, *, lens: str
) -> tuple[Believed, dict[int, str]]:
    """Step 2, its start: camera and poses from the near corners; views that are given up, with the reason."""
    rows = np.flatnonzero(~order.disorder)
    if not len(rows):
        raise CalibrationError(
            f"the corners of no view are in the target's order ({used.views[0].image} and all the others;"
            f" target {used.target.name!r}). Name the target that was photographed, or list its corners row"
            " by row."
        )
    given_up: dict[int, str] = {}
    try:
        calibration = _from_near(used, observations, order.near, rows, lens=lens)
    except CalibrationError:
        far = 1.0 - order.near.sum(1) / observations.counts
        doubtful = rows[far[rows] > DOUBTFUL_SHARE]
        if len(doubtful) in (0, len(rows)):
            raise
        given_up = {
            int(observations.order[row]): (
                f"{100 * far[row]:.0f} % of its corners are far from where the others put them, and with it"
                " the photographs fit no camera"
            )
            for row in doubtful
        }
        rows = np.setdiff1d(rows, doubtful)
        calibration = _from_near(used, observations, order.near, rows, lens=lens)
    poses = dict(
        zip(
            (view.image for view in calibration.detections.views), calibration.camera_from_target, strict=True
        )
    )
    reasons = dict(calibration.detections.set_aside)  # too few corners are near
    images = [used.views[i].image for i in observations.order]
    given_up |= {int(observations.order[row]): reasons[images[row]] for row in rows if images[row] in reasons}
    posed = np.array([row for row in rows if images[row] in poses], dtype=np.int64)
    stacked = Poses(
        np.array([poses[images[row]].rotation for row in posed]),
        np.array([poses[images[row]].translation for row in posed]),
    )
    some = observations.only(posed)
    near = order.near[posed, : some.ids.shape[1]]
    return (
        Believed(some, near, Estimate(calibration.camera, stacked), calibration.uncertainty.names),
        given_up,
    )


def _from_near(
    used: Detections,
    observations: Observations,
    near: Bool[ndarray, "m n"],
    rows: Int[ndarray, " v"],
    *,
    lens: str,
) -> Calibration:
    """FCCM of these rows' near corners, with a Cauchy loss."""
    chosen = replace(used, views=_views(used, observations.order[rows], near[rows]), set_aside=())
    return fit_flat(chosen, lens=lens, loss="cauchy", loss_scale=START_LOSS_SHARE * max(used.image_size))


def _settled(believed: Believed, points: Float[ndarray, "p 3"]) -> tuple[Believed, dict[int, str]]:
    """Steps 2 and 3 until nothing changes: what is believed then, and the strange views with the reason."""
    noise = noise_of(sizes_of(believed, points), believed.corners)
    believed = _refined(believed._replace(corners=believed.present), points, noise=noise)
    aside: dict[int, str] = {}
    for _ in range(REFINING_ROUNDS):
        tests = residual_tests(believed, points)
        corners = believed.present & ~tests.off
        if not tests.strange and (corners == believed.corners).all():
            break
        aside |= {int(believed.observations.order[row]): reason for row, reason in tests.strange.items()}
        rows = np.setdiff1d(np.arange(len(corners)), list(tests.strange))
        believed = _refined(believed._replace(corners=corners).only(rows), points, noise=tests.noise)
    return believed, aside


def _refined(believed: Believed, points: Float[ndarray, "p 3"], *, noise: float) -> Believed:
    """Camera and poses again, from the corners that are believed."""
    observations = replace(believed.observations, present=believed.corners.astype(float))
    problem = Reprojection(observations, points, believed.estimate.camera, believed.free)
    solution = solve(
        problem,
        believed.estimate,
        loss=Cauchy(max(OUTLYING_RATIO * noise, LEAST_HARM)),
        options=ROUGH_OPTIONS,
    )
    return believed._replace(estimate=solution.unknowns)


def _views(used: Detections, indices: Int[ndarray, " v"], corners: Bool[ndarray, "v n"]) -> tuple[View, ...]:
    """These views in the order of the photographs, each with its chosen corners."""
    chosen = {}
    for i, keep in zip(indices.tolist(), corners, strict=True):
        view = used.views[i]
        keep = keep[: len(view.ids)]
        chosen[i] = view if keep.all() else View(view.image, view.ids[keep], view.pixels[keep])
    return tuple(chosen[i] for i in sorted(chosen))


def _parted(
    used: Detections, believed: Believed, sizes: Float[ndarray, "m n"], aside: dict[int, str]
) -> Detections:
    """The detections without what was found, which is named."""
    order, off = believed.observations.order, believed.present & ~believed.corners
    outliers = []
    for row in np.argsort(order):
        view = used.views[order[row]]
        for k in np.flatnonzero(off[row]):
            reason = f"{sizes[row, k]:.1f} px from where the rest of the target puts it"
            outliers.append(
                Outlier(
                    view.image, int(view.ids[k]), (float(view.pixels[k, 0]), float(view.pixels[k, 1])), reason
                )
            )
    return replace(
        used,
        views=_views(used, order, believed.corners),
        set_aside=(*used.set_aside, *(SetAside(used.views[i].image, aside[i]) for i in sorted(aside))),
        outliers=(*used.outliers, *outliers),
    )
