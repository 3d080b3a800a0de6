"""How much steps are damped, and how long they are made."""

from __future__ import annotations

__all__ = ["LEAST_DAMPING", "Damping", "Pace"]

# Damping is at least this.
LEAST_DAMPING = 1e-15
# Promises shrink alike where the share of one and that of the next differ by less than this.
STEADY_SHARE = 0.2
# No step is made longer than so many times.
LONGEST_STEP = 10.0


class Damping:
    """lambda, after Nielsen: less the better a step kept its promise, ever more after steps up the cost.

    Faster than his: a narrow valley (rational lenses have them) is walked with hardly any damping and left
    with a lot.
    """

    def __init__(self, value: float) -> None:
        self.value, self._growth = value, 2.0

    def loosen(self, ratio: float) -> None:
        """After a step that gained `ratio` times what it had promised."""
        factor = 0.1 if ratio > 0.75 else max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
        self.value, self._growth = max(factor * self.value, LEAST_DAMPING), 2.0

    def tighten(self) -> None:
        """After a step that was not taken."""
        self.value, self._growth = self._growth * max(self.value, 1e-12), 4.0 * self._growth


class Pace:
    """How long a step is best.

    In a curved valley promises shrink by the same share time after time, as each step goes as much too far,
    or not far enough: a step that gains g times what it promised is 2 - g times as long as is best.
    """

    def __init__(self) -> None:
        self._promises: list[float] = []
        self._gain = 1.0

    def length(self, promised: float) -> float:
        """Of the next step, in steps as they are."""
        self._promises.append(promised)
        if len(self._promises) < 3:
            return 1.0
        first, second, third = self._promises[-3:]
        if not (third < second and abs(third * first / second**2 - 1.0) < STEADY_SHARE and self._gain < 2.0):
            return 1.0
        self._promises.clear()
        return min(1.0 / (2.0 - self._gain), LONGEST_STEP)

    def took(self, gain: float) -> None:
        """Says what the step gained, as a share of its promise."""
        self._gain = gain
