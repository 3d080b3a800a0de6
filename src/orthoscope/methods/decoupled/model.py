"""What may be chosen: base formula, shape of the target, lens of step 1, and how a formula is fitted."""

from __future__ import annotations

from typing import NamedTuple

from orthoscope.models.lenses.table import FREE

__all__ = ["BASES", "JOINT", "PAIRS", "Model"]

# These are the base formulas under a free lens, in order of preference.
BASES = ("brown", "kannala_brandt", "rational")
JOINT, PAIRS = "joint", "pairs"


class Model(NamedTuple):
    """One way to explain the photographs.

    Attributes:
        base: a formula.
        shape: the kind of the target's.
        first_lens: `free` or `formula`, the lens of step 1.
        formula: fitted to the pairs of step 1; None where step 1's camera is taken as it is.
    """

    base: str
    shape: str
    first_lens: str
    formula: str | None = None

    @property
    def lens(self) -> str:
        """What the camera's lens is called."""
        return self.formula or (FREE if self.first_lens == FREE else self.base)

    @property
    def fit(self) -> str:
        """How the lens was fitted."""
        return PAIRS if self.formula else JOINT

    @property
    def step_one(self) -> Model:
        """The model whose fit of step 1 this one rests on."""
        return self._replace(formula=None)
