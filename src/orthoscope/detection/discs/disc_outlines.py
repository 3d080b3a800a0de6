"""Outlines of discs in a photograph: by rays, then fitted to all pixels about them.

The outline is where grey crosses the middle between inside and outside, sought along rays from the centre
that are evenly spread in the ellipse's own frame. Blur moves it along the normal by as much on opposite
sides, so that the centre of the ellipse through it stays.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.discs.disc_fit import fit_discs
from orthoscope.detection.discs.disc_spots import SMOOTHING_SIGMA
from orthoscope.geometry.arrays import Float, median, ndarray
from orthoscope.geometry.ellipses import Ellipses, fit_ellipses

__all__ = ["Outlines", "fitted_whole", "outlines_near", "smoothed"]

# An outline is sought along so many rays.
RAY_COUNT = 32
# A ray has so many samples.
RAY_SAMPLES = 31
# The outline is sought from this share of the radius on.
INNER_RADIUS = 0.45
# The outline is sought up to this many radii; a neighbour begins beyond.
OUTER_RADIUS = 1.45
# The levels inside and outside are taken over this share of a radius at either end.
LEVEL_RADII = 0.25
# An outline is refined so many times.
REFINING_ROUNDS = 2
# Inside and outside differ by more than so many grey levels.
LEAST_CONTRAST = 8.0
# A contrast counts as at least this share.
LEAST_SHARE = 1e-3
# An outline's rms about its ellipse is less than this, radii.
MOST_ROUGHNESS = 0.12
# A disc that is fitted as a whole has a shorter half axis of at least so many blurs.
LEAST_BLURS = 1.1
# Of a sure centre the standard deviation by noise is less than this, pixels; measured is a sixth more, and so
# it is within a pixel as good as always.
WIDEST_SPREAD = 0.17
# Where rays cross the outline, a centre's standard deviation is so many times that of the fit to all pixels.
SPREAD_BY_RAYS = 1.5
# The fit of a whole disc ends within this share of its radius from there.
FARTHEST_MOVE_RADII = 0.25
# A sector of a whole disc's outline is off the ellipse by less than this share of a radius, or so many
# standard deviations.
MOST_SECTOR_RADII, MOST_SECTOR_SPREADS = 0.02, 4.0
# What is usual of all discs counts as noise, too: print and sharpening make outlines ragged; up to this share
# of a radius.
MOST_RAGGED_RADII = 0.1
# A fit leaves less of the picture than this, half steps from inside to outside, or than so many times what is
# usual: the edge of a shadow, glare or a finger moves a disc that it crosses.
MOST_REST, TIMES_USUAL_REST = 0.1, 3.0
# At least this share of the rays meets the outline.
LEAST_RAYS_SHARE = 0.9


class Outlines(NamedTuple):
    """Outlines of n discs.

    Attributes:
        ellipses: through them, NaN where there is no whole one.
        roughness: (n,) rms of an outline about its ellipse, in radii.
        contrast: (n,) from black to white, as a share of the white.
        doubt: (n,) how far a sector of it may be off unseen, radii; infinite where it was not fitted whole,
            or is hardly wider than the blur.
    """

    ellipses: Ellipses
    roughness: Float[ndarray, " n"]
    contrast: Float[ndarray, " n"]
    doubt: Float[ndarray, " n"]

    def of(self, which: ndarray) -> Outlines:
        """Those of some."""
        return Outlines(self.ellipses.of(which), *(part[which] for part in self[1:]))

    def with_more(self, more: Outlines) -> Outlines:
        """These, then more."""
        ellipses = Ellipses(*map(np.concatenate, zip(self.ellipses, more.ellipses, strict=True)))
        rest = (np.concatenate(pair) for pair in zip(self[1:], more[1:], strict=True))
        return Outlines(ellipses, *rest)


def smoothed(grey: ndarray, *, white: bool = False) -> ndarray:
    """A picture as `outlines_near` takes it, float32.

    Args:
        grey: (h,w) uint8.
        white: whether discs are brighter than what is around them; the picture is then less than 0.
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), SMOOTHING_SIGMA).astype(np.float32)
    return -smooth if white else smooth


def outlines_near(smooth: ndarray, rough: Ellipses) -> Outlines:
    """The outlines of discs, by rays.

    Args:
        smooth: (h,w), as `smoothed` makes it.
        rough: ellipses that are right to a quarter of their size.
    """
    angle = 2.0 * np.pi * np.arange(RAY_COUNT) / RAY_COUNT
    rays = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    fitted, roughness, contrast = rough, *np.full((2, len(rough.centres)), np.inf)
    for _ in range(REFINING_ROUNDS):
        known = np.isfinite(fitted.centres[:, 0])
        centres, axes = fitted.centres[known], fitted.axes[known]
        if not len(centres):
            break
        radii, contrast[known] = _outline(smooth, centres, axes @ rays.T)
        rims = centres[:, None] + radii[..., None] * np.einsum("nij,kj->nki", axes, rays)
        found = fit_ellipses(rims)
        places = np.linalg.solve(
            np.nan_to_num(found.axes, nan=1.0) + 1e-9 * np.eye(2),
            np.nan_to_num(rims - found.centres[:, None]).swapaxes(1, 2),
        )
        off = np.where(np.isfinite(radii), np.hypot(*places.swapaxes(0, 1)) - 1.0, np.nan)
        seen = np.isfinite(off).mean(1) >= LEAST_RAYS_SHARE
        off_radii = np.sqrt(np.nanmean(np.where(seen[:, None], off, 1.0) ** 2, axis=1))
        good = seen & (off_radii < MOST_ROUGHNESS)
        new_centres, new_axes = np.full_like(fitted.centres, np.nan), np.full_like(fitted.axes, np.nan)
        which = np.flatnonzero(known)[good]
        new_centres[which], new_axes[which] = found.centres[good], found.axes[good]
        roughness[which] = off_radii[good]
        fitted = Ellipses(new_centres, new_axes)
    return Outlines(fitted, roughness, contrast, np.full(len(roughness), np.inf))


def fitted_whole(grey: ndarray, outlines: Outlines) -> Outlines:
    """Outlines by rays, each fitted to all pixels about it, but for discs hardly wider than the blur; NaN
    where one is not whole in the picture, something lies over it, or noise hides where it is.

    Args:
        grey: (h,w) uint8.
        outlines: as `outlines_near` finds them.
    """
    found, doubt = outlines.ellipses, np.full(len(outlines.doubt), np.inf)
    which = np.flatnonzero(np.isfinite(found.centres[:, 0]))
    fit = fit_discs(grey, found.of(which))
    moved = np.linalg.norm(fit.ellipses.centres - found.centres[which], axis=1)
    size = np.sqrt(np.abs(np.linalg.det(found.axes[which])))
    wide = np.abs(np.linalg.eigvalsh(found.axes[which])).min(1, initial=np.inf) > LEAST_BLURS * fit.blur
    taken = wide & (moved < FARTHEST_MOVE_RADII * size)
    ragged = median(np.abs(fit.off[taken])) / 0.6745 if taken.any() else 0.0
    most = MOST_SECTOR_SPREADS * np.hypot(fit.spread, ragged)
    off = np.maximum(
        MOST_SECTOR_RADII * size[:, None],
        np.minimum(most, MOST_RAGGED_RADII * size[:, None] + MOST_SECTOR_SPREADS * fit.spread),
    )
    clean = fit.rest < max(MOST_REST, TIMES_USUAL_REST * median(fit.rest))
    spread = np.where(taken, fit.centre_spread, SPREAD_BY_RAYS * fit.centre_spread)
    smooth = ((np.abs(fit.off) < off).all(1) | ~taken) & clean & (spread < WIDEST_SPREAD)
    centres, axes = found.centres.copy(), found.axes.copy()
    centres[which[taken]], axes[which[taken]] = fit.ellipses.centres[taken], fit.ellipses.axes[taken]
    centres[which[~smooth]], axes[which[~smooth]] = np.nan, np.nan
    reach = np.linalg.norm(axes, axis=2)
    inside = ((centres > reach) & (centres < np.array(grey.shape[::-1]) - 1 - reach)).all(1)
    centres[~inside], axes[~inside] = np.nan, np.nan
    doubt[which[taken]] = (off.max(1) / size)[taken]
    return outlines._replace(ellipses=Ellipses(centres, axes), doubt=doubt)


def _outline(
    smooth: ndarray, centres: ndarray, arms: Float[ndarray, "n 2 k"]
) -> tuple[Float[ndarray, "n k"], Float[ndarray, " n"]]:
    """How far along each ray, in radii, grey rises through the middle between inside and outside, NaN where
    it does not, or where the ray leaves the picture; and each disc's contrast.
    """
    radius = np.linspace(INNER_RADIUS, OUTER_RADIUS, RAY_SAMPLES)
    x, y = (centres[:, i, None, None] + arms[:, i, :, None] * radius for i in (0, 1))
    shape = (-1, RAY_COUNT * RAY_SAMPLES)
    grey = cv2.remap(
        smooth,
        x.reshape(shape).astype(np.float32),
        y.reshape(shape).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).reshape(x.shape)
    ends = max(2, round(RAY_SAMPLES * LEVEL_RADII / (OUTER_RADIUS - INNER_RADIUS)))
    inside = np.median(grey[..., :ends], axis=(1, 2))[:, None]
    outside = np.median(grey[..., -ends:], axis=2)
    level = 0.5 * (inside + outside)[..., None]
    above = grey > level
    rises = above[..., 1:] & ~above[..., :-1]
    first = rises.argmax(-1)
    low, high = (np.take_along_axis(grey, (first + i)[..., None], -1)[..., 0] for i in (0, 1))
    share = (level[..., 0] - low) / np.maximum(high - low, 1e-6)
    found = radius[first] + share * (radius[1] - radius[0])
    height, width = smooth.shape
    far_x, far_y = (centres[:, i, None] + arms[:, i] * 1.1 for i in (0, 1))
    in_picture = (far_x > 0) & (far_x < width - 1) & (far_y > 0) & (far_y < height - 1)
    good = rises.any(-1) & in_picture & (outside - inside > LEAST_CONTRAST)
    white = np.maximum(np.abs(np.median(outside, axis=1)), np.abs(inside[:, 0]))
    contrast = np.median(outside - inside, axis=1) / np.maximum(white, 1.0)
    return np.where(good, found, np.nan), np.maximum(contrast, LEAST_SHARE)
