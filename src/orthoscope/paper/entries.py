"""Who is compared: the paper's three, and the peers that get a fair chance.

The paper's FCCM has k1 and k2 about the principal point, although the simulated lens has tangential terms and
a centre of its own; its NMLDC and MLDC have `pfet` about a centre of their own. Fair chances are FCCM with 5
parameters, every other method of METHODS and, in a table, every method with every lens.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from orthoscope.methods import METHODS
from orthoscope.models.lenses import LENSES

__all__ = ["FCCM", "FCCM5", "MLDC", "NMLDC", "PAPER", "Entry", "every_lens", "fair_peers", "with_skew"]

TOLD: dict[
    str, Mapping[str, Any]
] = {  # what a method need not find out: the simulated board is flat, and all tests are on flat boards
    "decoupled": {"target": "flat", "through": "free"},
}
FCCM, NMLDC, MLDC, FCCM5 = "FCCM", "NMLDC", "MLDC", "FCCM 5 parameters"


class Entry(NamedTuple):
    """A method with its settings, under the name that figures and tables give it."""

    name: str
    method: str
    settings: Mapping[str, Any]


PAPER = (
    Entry(FCCM, "fccm", {"lens": "brown:k1,k2"}),
    Entry(NMLDC, "nmldc", {"lens": "pfet"}),
    Entry(MLDC, "mldc", {"lens": "pfet"}),
)


def fair_peers() -> tuple[Entry, ...]:
    """FCCM with k1, k2, p1, p2 and k3; and methods that the paper does not know."""
    others = sorted(set(METHODS) - {entry.method for entry in PAPER})
    return (
        Entry(FCCM5, "fccm", {"lens": "brown"}),
        *(Entry(name, name, TOLD.get(name, {})) for name in others),
    )


def every_lens(lenses: tuple[str, ...] = tuple(LENSES)) -> tuple[Entry, ...]:
    """Every method with every lens, the coefficients free that a user gets by naming it."""
    return tuple(
        Entry(f"{method} {lens}", method, {"lens": lens, **TOLD.get(method, {})})
        for method in METHODS
        for lens in lenses
    )


def with_skew(entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """The same, with oblique pixel axes allowed, as in the paper's Table 1."""
    return tuple(entry._replace(settings={**entry.settings, "skew": True}) for entry in entries)
