"""The settings of each method, for editors and type checkers: what `calibrate(..., method="fccm")` takes.

Each method's own function says what they mean; a test compares the two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypedDict

__all__ = [
    "DecoupledSettings",
    "FccmSettings",
    "FitzgibbonSettings",
    "HartleyKangSettings",
    "MldcSettings",
    "NmldcSettings",
]


class DecoupledSettings(TypedDict, total=False):
    """Of `methods.decoupled.decoupled`."""

    lens: str
    shape: str
    base: str
    first_lens: str
    fit: str
    formulas: Sequence[str]
    skew: bool
    judging: Callable[[int, int], None] | None


class FccmSettings(TypedDict, total=False):
    """Of `methods.fccm`."""

    lens: str
    own_centre: bool
    skew: bool
    loss: str
    loss_scale: float
    max_steps: int
    progress: Callable[[int, float], None] | None


class NmldcSettings(TypedDict, total=False):
    """Of `methods.mldc.nmldc`."""

    lens: str
    measure: str
    skew: bool
    loss: str
    loss_scale: float
    max_steps: int
    progress: Callable[[int, float], None] | None


class MldcSettings(TypedDict, total=False):
    """Of `methods.mldc.mldc`."""

    correct: str
    lens: str
    damping: float
    damp: str
    weights: Sequence[float]
    skew: bool
    loss: str
    loss_scale: float
    rounds: int
    max_steps: int
    progress: Callable[[int, float], None] | None


class HartleyKangSettings(TypedDict, total=False):
    """Of `methods.radial_curve.hartley_kang`."""

    lens: str
    skew: bool


class FitzgibbonSettings(TypedDict, total=False):
    """Of `methods.radial_curve.fitzgibbon`."""

    lens: str
    skew: bool
