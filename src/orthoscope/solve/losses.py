"""Robust losses: what a squared residual costs, and the weight that makes least squares minimise that cost.

q = |e|^2 of one measurement, c the scale (in the residual's unit); rho(q) ~ q for q << c^2; weight = d rho /
d q. P. Huber, Robust Statistics, 1981; F. Hampel et al., Robust Statistics, 1986.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import InputError, ndarray

__all__ = ["LOSSES", "USUAL_SCALE", "Cauchy", "Huber", "Linear", "Loss"]

# A loss forgives from this residual on where nobody says otherwise: found corners miss by less, pixels.
USUAL_SCALE = 1.0


@dataclass(frozen=True)
class Loss(ABC):
    """A cost of squared residuals.

    Attributes:
        scale: the residual from which on the loss forgives, in the residual's unit.
    Raises:
        InputError: the scale is not positive.
    """

    scale: float = USUAL_SCALE

    def __post_init__(self) -> None:
        if not self.scale > 0:
            raise InputError(
                f"a loss of scale {self.scale} weighs nothing; expected a positive scale, in pixels."
            )

    @abstractmethod
    def cost(self, squared: ndarray) -> ndarray | np.float64:
        """rho(q) of squared residuals q >= 0."""

    @abstractmethod
    def weight(self, squared: ndarray) -> ndarray | None:
        """d rho / d q of squared residuals q >= 0; None where it is 1 everywhere."""


class Linear(Loss):
    """Least squares."""

    def cost(self, squared: ndarray) -> ndarray:
        return squared

    def weight(self, squared: ndarray) -> None:
        return None


class Huber(Loss):
    """Squares near, absolute values far."""

    def cost(self, squared: ndarray) -> ndarray:
        c = self.scale
        return np.where(squared <= c * c, squared, 2.0 * c * np.sqrt(squared) - c * c)

    def weight(self, squared: ndarray) -> ndarray:
        return np.minimum(1.0, self.scale / np.sqrt(np.maximum(squared, 1e-300)))


class Cauchy(Loss):
    """Squares near, logarithm far: a gross error is all but forgotten."""

    def cost(self, squared: ndarray) -> ndarray | np.float64:
        c2 = self.scale**2
        return c2 * np.log1p(squared / c2)

    def weight(self, squared: ndarray) -> ndarray:
        return 1.0 / (1.0 + squared / self.scale**2)


LOSSES: dict[str, type[Loss]] = {"linear": Linear, "huber": Huber, "cauchy": Cauchy}
