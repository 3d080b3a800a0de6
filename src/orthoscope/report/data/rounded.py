"""Arrays as the page carries them: whole numbers in small units, null where there is no number.

Places are in tenths of a pixel and residuals in thousandths: finer than a screen shows, half the bytes.
"""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["PLACE_UNITS", "RESIDUAL_UNITS", "digits", "whole"]

# A place is told in so many units a pixel.
PLACE_UNITS = 10
# A residual is told in so many units a pixel.
RESIDUAL_UNITS = 1000


def whole(values: ndarray, units: int) -> list:
    """Numbers in units, rounded to whole ones."""
    finite = np.isfinite(values)
    rounded = np.rint(np.where(finite, values, 0.0) * units).astype(np.int64)
    if finite.all():
        return rounded.tolist()
    known = rounded.astype(object)
    known[~finite] = None
    return known.tolist()


def digits(values: ndarray, count: int = 5) -> list:
    """Numbers to so many significant digits."""
    flat = [float(f"{value:.{count}g}") if np.isfinite(value) else None for value in np.ravel(values)]
    return np.array(flat, dtype=object).reshape(np.shape(values)).tolist()
