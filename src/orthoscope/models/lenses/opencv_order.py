"""OpenCV's distortion vector: which coefficient stands where.

k1 k2 p1 p2 | k3 | k4 k5 k6 | s1 s2 s3 s4 | tau_x tau_y, the first 4, 5, 8, 12 or 14 of them, as
cv2.calibrateCamera returns and cv2.projectPoints takes them; cv2.fisheye has k1 k2 k3 k4 of its own formula.
"""

from __future__ import annotations

from orthoscope.geometry.arrays import InputError
from orthoscope.models.lenses.decentred import Brown, Rational
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.radial import KannalaBrandt

__all__ = ["OPENCV_ORDER", "opencv_coefficients", "opencv_distortion"]

OPENCV_ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y")
# OpenCV takes vectors of these lengths.
VECTOR_LENGTHS = (5, 8, 12, 14)


def opencv_coefficients(lens: Brown | Rational) -> list[float]:
    """The coefficients in OpenCV's order: as few of 5, 8, 12 or 14 as hold them all."""
    known = dict(zip(lens.names(), lens.coefficients.tolist(), strict=True))
    values = [known.get(name, 0.0) for name in OPENCV_ORDER]
    used = max((i + 1 for i, value in enumerate(values) if value), default=0)
    shortest = 8 if isinstance(lens, Rational) else 5
    return values[: next(length for length in VECTOR_LENGTHS if length >= max(used, shortest))]


def opencv_distortion(lens: Lens) -> list[float]:
    """What OpenCV calls `distCoeffs`: cv2's for brown and rational, cv2.fisheye's for kannala_brandt.

    Raises:
        InputError: OpenCV has no such formula.
    """
    if isinstance(lens, Brown | Rational):
        return opencv_coefficients(lens)
    if isinstance(lens, KannalaBrandt):
        return lens.coefficients.tolist()
    raise InputError(
        f"OpenCV has no lens such as this {type(lens).__name__}; expected brown, rational or kannala_brandt."
        ' Calibrate with lens="brown", or export(calibration, path, "opencv"), which takes the nearest one.'
    )
