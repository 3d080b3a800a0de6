"""Copies of a photograph of other sizes: smaller ones, in which a board is found sooner, or a larger one."""

from __future__ import annotations

import cv2

from orthoscope.geometry.arrays import ndarray

__all__ = ["enlarged", "resized", "to_photograph"]


def resized(grey: ndarray, side: int) -> ndarray:
    """A copy whose longer side is `side`; the photograph itself where it is no larger. By halves first: five
    times as quick.
    """
    longer = max(grey.shape)
    if not 0 < side < longer:
        return grey
    if longer >= 2 * side and min(grey.shape) >= 2:
        height, width = (length // 2 for length in grey.shape)
        half = cv2.resize(grey[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA)
        return resized(half, side)
    height, width = (max(1, round(length * side / longer)) for length in grey.shape)
    return cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)


def enlarged(grey: ndarray) -> ndarray:
    """A copy twice as large, in which small squares are told apart."""
    return cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)


def to_photograph(pixels: ndarray, copy: ndarray, grey: ndarray) -> ndarray:
    """Where pixels (..., 2) of a copy are in the photograph."""
    scale = [whole / part for whole, part in zip(grey.shape[::-1], copy.shape[::-1], strict=True)]
    return (pixels + 0.5) * scale - 0.5
