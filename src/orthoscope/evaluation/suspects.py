"""Which photographs do not belong, and which are precious.

A photograph does not belong where its own residuals, after the fit that used it, are far above the typical
photograph's. What they are like says why: white where its corners were found badly, smooth over the board
where the board was bent in another way (which is no fault of its corners, and no reason to leave it out).
Held-out error does not tell: it is large too where nothing else shows what the photograph shows, and such a
photograph is *precious*; more like it are what the camera needs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.evaluation.coverage import place_of
from orthoscope.fitting.slopes.linearised import Linearised
from orthoscope.fitting.unseen.scatter import patterns_over_views
from orthoscope.geometry.arrays import Float, median, ndarray
from orthoscope.geometry.numbers import rough_pixels
from orthoscope.targets.detections import Detections

__all__ = ["ViewError", "precious_among", "suspects_among"]

# A photograph is a suspect with more than this many times the typical photograph's rms.
SUSPECT_FACTOR = 2.5
# An rms that is smaller in itself, pixels, makes no suspect.
NOTABLE_PX = 0.3
# Where a board was bent patterns of low order explain more than this share of the squared residuals.
SMOOTH_SHARE = 0.6
# Left out, a photograph that stands alone has more than this many times its own residual.
ALONE_FACTOR = 2.0
# A photograph that stands alone also has more than this many times the typical left-out error.
GAINED_FACTOR = 1.5
# With fewer views none of them can be told from the others.
FEWEST_TELLING_VIEWS = 5


@dataclass(frozen=True, eq=False)
class ViewError:
    """One photograph's share.

    Attributes:
        image: its name.
        corners: that were used.
        rms_px: per point, in the calibration.
        held_out_rms_px: when it was held out; NaN where that was not done.
    """

    image: str
    corners: int
    rms_px: float
    held_out_rms_px: float


def suspects_among(
    views: tuple[ViewError, ...], known: Linearised | None, points: Float[ndarray, "p 3"]
) -> tuple[tuple[str, str], ...]:
    """Images of the photographs that do not belong, with what is wrong.

    Args:
        known: a fit of them, linearised, where there is one.
        points: the target's corners, nominal.
    """
    errors = np.array([view.rms_px for view in views])
    if len(views) < FEWEST_TELLING_VIEWS:
        return ()
    typical = median(errors)
    odd = np.flatnonzero(errors > max(SUSPECT_FACTOR * typical, NOTABLE_PX))
    if not len(odd):
        return ()
    smooth = _smooth_share(known, points) if known else np.zeros(len(views))
    return tuple((views[i].image, _wrong(views[i].rms_px, typical, smooth[i])) for i in odd)


def _wrong(error: float, typical: float, smooth: float) -> str:
    figures = (
        f"corners are off by {rough_pixels(error)} px, in a typical photograph by {rough_pixels(typical)}"
    )
    why = (
        "the target was bent another way"
        if smooth > SMOOTH_SHARE
        else "it may be blurred, or the target or the camera moved"
    )
    return f"{figures}: {why}"


def _smooth_share(known: Linearised, points: Float[ndarray, "p 3"]) -> Float[ndarray, " m"]:
    """The share of each view's squared residuals that patterns of order 2 and 3 over the board explain."""
    patterns = np.concatenate(patterns_over_views(known, points, orders=(2, 3)), axis=2)
    explained = ((known.errors[:, None] @ patterns)[:, 0] ** 2).sum(1)
    return explained / np.maximum((known.errors**2).sum(1), 1e-300)


def precious_among(
    detections: Detections, within: Float[ndarray, " m"], without: Float[ndarray, " m"]
) -> tuple[tuple[str, str], ...]:
    """Images of the photographs that alone show some place of the frame, with that place.

    Args:
        within, without: squared error of each view with it and without it, px^2.
    """
    corners = np.array([len(view.ids) for view in detections.views], dtype=float)
    if len(corners) < FEWEST_TELLING_VIEWS:
        return ()
    own, foreseen = np.sqrt(within / corners), np.sqrt(without / corners)
    typical = median(foreseen[~np.isnan(foreseen)])
    alone = np.isnan(foreseen) | ((foreseen > ALONE_FACTOR * own) & (foreseen > GAINED_FACTOR * typical))
    return tuple(
        (view.image, place_of(view.pixels, detections.image_size))
        for view, is_alone in zip(detections.views, alone, strict=True)
        if is_alone
    )
