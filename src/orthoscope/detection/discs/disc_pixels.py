"""The pixels about the outlines of discs, gathered once for all steps of a fit."""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["OUTER_RADII", "SPARE_REACH", "Pixels"]

# No pixel beyond so many radii takes part: there the next disc may begin.
OUTER_RADII = 1.45
# So many discs of a size say which pixels are near the outlines of all of them.
LIKE_DISCS = 4
# Pixels that may take part are sought up to so many times as far from the outline as that blur reaches.
SPARE_REACH = 1.5
# Nearer to another disc than this, pixels, a pixel is not asked, where the blur is not known yet or wide.
FIRST_REACH = 4.0


class Pixels:
    """The pixels about the outlines of n discs: values less their mean, offsets (2,k) from the middle.

    Args:
        grey: (h,w) uint8.
        centres, axes: of all discs.
        some: those n.
        reach: pixels farther from an outline are not asked, nor are those as near to that of another disc.
    """

    def __init__(
        self,
        grey: ndarray,
        centres: Float[ndarray, "m 2"],
        axes: Float[ndarray, "m 2 2"],
        some: Int[ndarray, " n"],
        reach: float,
    ) -> None:
        height, width = grey.shape
        self.middle = np.clip(np.rint(centres[some]).astype(int), 0, (width - 1, height - 1))
        side = int(np.ceil(OUTER_RADII * np.linalg.norm(axes[some], axis=2).max())) + 1
        offsets = np.mgrid[-side : side + 1, -side : side + 1].reshape(2, -1)[::-1].astype(np.float32)
        few = axes[some][:: max(1, len(some) // LIKE_DISCS)]
        radii, away = _distances(np.broadcast_to(offsets, (len(few), *offsets.shape)), few)
        near = ((radii < OUTER_RADII + 0.1) & (np.abs(away) < reach)).any(0)
        self.offsets = offsets[:, near]
        column, row = self.middle.T[:, :, None] + self.offsets.astype(int)[:, None]
        self.inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        values = grey[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(np.float32)
        self.level = values.mean(1)
        self.values = values - self.level[:, None]
        self._leave_out_others(centres, axes, some, min(reach / SPARE_REACH, FIRST_REACH))

    def _leave_out_others(self, centres: ndarray, axes: ndarray, some: ndarray, reach: float) -> None:
        """Pixels within reach of another disc are not this one's alone."""
        apart = centres - centres[some, None]
        span = np.linalg.norm(np.einsum("nij,nmj->nmi", np.linalg.inv(axes[some]), apart), axis=2)
        half = np.abs(np.linalg.eigvalsh(axes[some])).min(1)
        close = (span < 2.0 + 2.0 * reach / half[:, None]) & (span > 1e-9)
        mine, other = np.nonzero(close)
        if len(mine):
            places = self.offsets + (self.middle[mine] - centres[other])[:, :, None].astype(np.float32)
            theirs = _distances(places, axes[other])[1] < reach
            np.logical_and.at(self.inside, mine, ~theirs)


def _distances(
    offsets: Float[ndarray, "n 2 k"], axes: Float[ndarray, "n 2 2"]
) -> tuple[Float[ndarray, "n k"], Float[ndarray, "n k"]]:
    """Of offsets from the centres of ellipses the radius in each one's frame, and the distance from it along
    the ray, pixels.
    """
    radii = np.linalg.norm(np.linalg.inv(axes).astype(np.float32) @ offsets, axis=1)
    return radii, (radii - 1.0) * np.linalg.norm(offsets, axis=1) / np.maximum(radii, 1e-6)
