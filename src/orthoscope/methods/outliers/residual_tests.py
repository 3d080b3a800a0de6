"""Whether corners and views belong, the camera being known as well as it can be: step 3 of outliers.py.

A *corner* is off where all of this holds:
1. its residual is beyond the limit, OUTLYING_RATIO times the noise of the typical view, of this view (up to
   WORST_VIEW_RATIO times as much) or of this place of the image, whichever is largest;
2. so is what neither the target's shape (systematic.py) nor a trend that the view's other corners share
   (view_polynomial.py) explains of it;
3. its pixel is off the plane through its neighbours' by more than UNEVEN_SHARE of the residual; else only the
   lens formula is wrong there.

A *view* is strange where more than half of its corners are beyond STRANGE_RATIO times the noise at places of
the image where other views have no such errors. Noise comes from medians, which half of the corners may spoil
before they do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.fitting.observations import Observations
from orthoscope.fitting.reprojection import Estimate, Reprojection
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray
from orthoscope.methods.outliers.systematic import by_target, cells_of, thirds_of_groups
from orthoscope.methods.outliers.view_polynomial import DOUBTED_WEIGHT, local_misses, medians, trends

__all__ = ["Believed", "ResidualTests", "noise_of", "residual_tests", "sizes_of"]

# A residual is suspect beyond this many times the noise of one coordinate. Real corners have heavy tails:
# those of udacity reach 8, those of babel-cube, at its rim, 22.
OUTLYING_RATIO = 10.0
# A suspect corner is off the plane through its neighbours by more than this share of its residual: where a
# lens formula has folded over, it misses by 100 px what lies as smoothly in the photograph as ever.
UNEVEN_SHARE = 0.15
# Half of a view's corners at once are beyond this many times the noise only where the view is strange.
STRANGE_RATIO = 4.0
# Some views have this many times the noise of the typical one, and yet belong.
WORST_VIEW_RATIO = 3.0
# The trend has this order: what a lens formula cannot follow bends over a view, noise does not.
TREND_ORDER = 2
# A residual below this harms no camera, pixels.
LEAST_HARM = 0.3
# A corner that the camera cannot see at all misses by this, pixels.
UNSEEN_MISS = 1e6
# The median size of an error of standard deviation 1 in both coordinates (Rayleigh's distribution).
MEDIAN_SIZE = float(np.sqrt(2.0 * np.log(2.0)))
# A third of such errors is below this size.
THIRD_SIZE = float(np.sqrt(2.0 * np.log(1.5)))


class Believed(NamedTuple):
    """What is believed so far.

    Attributes:
        observations: the views with all their corners.
        corners: which of these are believed, (m,n).
        estimate: camera and poses.
        free: the parameters of the camera that move.
    """

    observations: Observations
    corners: Bool[ndarray, "m n"]
    estimate: Estimate
    free: tuple[str, ...]

    @property
    def present(self) -> Bool[ndarray, "m n"]:
        """Where the table has corners."""
        return self.observations.present > 0

    def only(self, rows: Int[ndarray, " v"]) -> Believed:
        """What is believed of these rows (ascending)."""
        observations = self.observations.only(rows)
        estimate = Estimate(self.estimate.camera, self.estimate.poses.only(rows))
        return Believed(observations, self.corners[rows, : observations.ids.shape[1]], estimate, self.free)


class ResidualTests(NamedTuple):
    """What the tests find.

    Attributes:
        off: corners that do not belong, (m,n).
        strange: rows of views that do not, with the reason.
        noise: of one coordinate, pixels.
    """

    off: Bool[ndarray, "m n"]
    strange: dict[int, str]
    noise: float


def residual_tests(believed: Believed, points: Float[ndarray, "p 3"]) -> ResidualTests:
    """Which corners are off and which views are strange, by what is believed so far.

    Args:
        believed: views, camera and poses.
        points: of the target, (p,3) metres.
    """
    residuals = _residuals(believed, points)
    sizes = np.hypot(residuals[..., 0], residuals[..., 1])
    noise = noise_of(sizes, believed.corners)
    cells = np.zeros(sizes.shape, dtype=np.int64)
    # A corner counts for the cell where it should be.
    cells[believed.present] = cells_of((believed.observations.pixels() + residuals)[believed.present])
    off = _off(believed, points, residuals, cells, noise=noise)
    return ResidualTests(off, _strange(believed, sizes, cells, noise=noise), noise)


def sizes_of(believed: Believed, points: Float[ndarray, "p 3"]) -> Float[ndarray, "m n"]:
    """|residual| of all corners, pixels; 0 in the padding."""
    return np.hypot(*np.moveaxis(_residuals(believed, points), -1, 0))


def noise_of(sizes: Float[ndarray, "m n"], corners: Bool[ndarray, "m n"]) -> float:
    """The noise of one coordinate in the typical view, pixels, by the median of |residual|.

    Args:
        sizes: |residual| of all corners, (m,n) pixels.
        corners: those that count, (m,n).
    """
    return median(medians(sizes, corners.astype(float))) / MEDIAN_SIZE


def _off(
    believed: Believed,
    points: Float[ndarray, "p 3"],
    residuals: Float[ndarray, "m n 2"],
    cells: Int[ndarray, "m n"],
    *,
    noise: float,
) -> Bool[ndarray, "m n"]:
    """Which corners are off; the tests that cost time are for those only that fail the first.

    Args:
        believed: views, camera and poses.
        points: of the target, (p,3) metres.
        residuals: of all corners, (m,n,2) pixels.
        cells: of the image, in which these corners should be, (m,n).
        noise: of one coordinate, pixels.
    """
    sizes = np.hypot(residuals[..., 0], residuals[..., 1])
    of_view = np.clip(
        medians(sizes, believed.corners.astype(float)) / MEDIAN_SIZE, noise, WORST_VIEW_RATIO * noise
    )
    of_place = _noise_there(sizes, cells, believed.present)
    limit = np.maximum(OUTLYING_RATIO * np.maximum(of_view[:, None], of_place), LEAST_HARM)
    suspect = believed.present & (sizes > limit)
    if not suspect.any():
        return suspect
    observations = believed.observations
    ids = np.where(believed.present, observations.ids, -1)
    left = residuals - by_target(observations, points, believed.estimate, residuals, noise=noise)
    rows = np.flatnonzero(suspect.any(1))
    say = observations.present[rows] * np.where(suspect[rows], DOUBTED_WEIGHT, 1.0)
    alone = np.zeros_like(suspect)
    alone[rows] = (
        trends(points[observations.ids[rows], :2], left[rows], say, order=TREND_ORDER).misses > limit[rows]
    )
    uneven = local_misses(points, ids, observations.pixels(), suspect) > UNEVEN_SHARE * sizes
    return suspect & alone & uneven


def _strange(
    believed: Believed, sizes: Float[ndarray, "m n"], cells: Int[ndarray, "m n"], *, noise: float
) -> dict[int, str]:
    """The rows of strange views, with the reason."""
    present, typical = believed.present, medians(sizes, believed.observations.present)
    strange = {}
    for row in np.flatnonzero(typical > max(STRANGE_RATIO * noise, LEAST_HARM)):
        others = present.copy()
        others[row] = False
        of_place = _noise_there(sizes, cells, others)[row]
        off = present[row] & (sizes[row] > STRANGE_RATIO * np.maximum(of_place, noise))
        if 2 * off.sum() > present[row].sum():
            strange[int(row)] = (
                f"half of its corners are {typical[row]:.3g} px or more from where the camera of the other"
                f" photographs sees them (in those it is {MEDIAN_SIZE * noise:.2g} px): another target, or"
                " one that moved or was bent"
            )
    return strange


def _noise_there(
    sizes: Float[ndarray, "m n"], cells: Int[ndarray, "m n"], among: Bool[ndarray, "m n"]
) -> Float[ndarray, "m n"]:
    """For each corner the noise of one coordinate in its cell of the image, pixels.

    Args:
        sizes: |residual| of all corners, (m,n) pixels.
        cells: of the image, (m,n).
        among: the corners that tell it, (m,n).
    Returns:
        (m,n); infinite in cells without such corners.
    """
    return thirds_of_groups(sizes[among], cells[among], int(cells.max(initial=0)) + 1)[cells] / THIRD_SIZE


def _residuals(believed: Believed, points: Float[ndarray, "p 3"]) -> Float[ndarray, "m n 2"]:
    """Predicted minus detected of all corners, pixels.

    It is UNSEEN_MISS for a corner that the camera does not see, and 0 in the padding.
    """
    residuals = Reprojection(believed.observations, points, believed.estimate.camera).residuals(
        believed.estimate
    )
    return np.nan_to_num(residuals, nan=UNSEEN_MISS)
