"""Who is compared: the paper's three as they are printed, and, set apart, ours.

As printed: FCCM has k1 and k2 about the principal point, although the simulated lens has tangential terms and
a centre of its own; NMLDC measures straightness in the straightened image, with the fourth order of the
polynomial (of the fifth it makes nothing at 1 px of noise); MLDC searches eq. (7) from the closed form, with
identity damping. A search takes many times what the others take, so only the first trials have it. Ours are
the same methods as they can be made to work, FCCM with a lens that can follow this one, every other method of
METHODS and, in a table, every method with every lens.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from orthoscope.evaluation.comparison.entry import parse_entry
from orthoscope.fitting.calibration import Calibration
from orthoscope.geometry.arrays import InputError
from orthoscope.methods import METHODS, calibrate, settings_of
from orthoscope.models.lenses.table import LENSES
from orthoscope.targets.detections import Detections

__all__ = [
    "FCCM",
    "FCCM5",
    "MLDC",
    "NEAREST",
    "NMLDC",
    "OURS",
    "OWN_CENTRE",
    "PAPER",
    "REPAIRED",
    "REPEATED",
    "PaperEntry",
    "every_lens",
    "fair_peers",
    "own_entry",
    "with_skew",
]

# A method need not find out that the simulated board is flat, as in all tests.
TOLD_SETTINGS: dict[str, Mapping[str, Any]] = {
    "decoupled": {"shape": "flat", "first_lens": "free"},
}
# A method that takes as long as all others together takes part in so many trials.
FEW_TRIALS: dict[str, int] = {"decoupled": 2}
FCCM, NMLDC, MLDC = "FCCM", "NMLDC, plain", "MLDC, eq. (7)"
REPEATED, NEAREST, REPAIRED = "MLDC, repeated", "MLDC, nearest", "NMLDC, repaired"
FCCM5, OWN_CENTRE = "FCCM 5 parameters", "FCCM pfet, own centre"
# Every method is tried with every lens in so many trials: rows differ by far more than trials do.
LENS_TRIALS = 1
# Eq. (7) is searched in so many trials.
SEARCHED_TRIALS = 2


class PaperEntry(NamedTuple):
    """A method with its settings, under the name that figures and tables give it.

    Attributes:
        name: shown.
        method: of METHODS, or a function that takes detections and settings.
        settings: of it.
        most_trials: in how many trials it takes part, all by default.
    """

    name: str
    method: str | Callable[..., Calibration]
    settings: Mapping[str, Any]
    most_trials: int | None = None

    def calibrate(self, detections: Detections) -> Calibration:
        """Its calibration from detections."""
        if isinstance(self.method, str):
            return calibrate(detections, method=self.method, **self.settings)
        return self.method(detections, **self.settings)

    @property
    def called(self) -> str:
        """The method's name."""
        return self.method if isinstance(self.method, str) else getattr(self.method, "__name__", self.name)

    def takes(self, setting: str) -> bool:
        """Whether the method has a setting."""
        if isinstance(self.method, str):
            return setting in settings_of(self.method)
        return setting in inspect.signature(self.method).parameters


PAPER = (
    PaperEntry(FCCM, "fccm", {"lens": "brown:k1,k2"}),
    PaperEntry(NMLDC, "nmldc", {"lens": "pfet:a1,a2,a3,a4", "measure": "straight-image"}),
    PaperEntry(MLDC, "mldc", {"lens": "pfet", "correct": "literal"}, SEARCHED_TRIALS),
)
OURS = (
    PaperEntry(REPEATED, "mldc", {"lens": "pfet"}),
    PaperEntry(NEAREST, "mldc", {"lens": "pfet", "correct": "nearest"}),
    PaperEntry(REPAIRED, "nmldc", {"lens": "pfet"}),
    PaperEntry(OWN_CENTRE, "fccm", {"lens": "pfet", "own_centre": True}),
    PaperEntry(FCCM5, "fccm", {"lens": "brown"}),
)


def fair_peers() -> tuple[PaperEntry, ...]:
    """Ours: the paper's methods as they can be made to work, and methods that the paper does not know."""
    others = sorted(set(METHODS) - {entry.method for entry in (*PAPER, *OURS)})
    peers = (PaperEntry(name, name, TOLD_SETTINGS.get(name, {}), FEW_TRIALS.get(name)) for name in others)
    return (*OURS, *peers)


def every_lens(lenses: tuple[str, ...] = tuple(LENSES)) -> tuple[PaperEntry, ...]:
    """Every method that takes a lens with every lens, the coefficients free that a user gets by naming it."""
    return tuple(
        PaperEntry(
            f"{method} {lens}",
            method,
            {"lens": lens, **TOLD_SETTINGS.get(method, {})},
            LENS_TRIALS,
        )
        for method in METHODS
        if "lens" in settings_of(method)
        for lens in lenses
    )


def with_skew(entries: tuple[PaperEntry, ...]) -> tuple[PaperEntry, ...]:
    """The same, with oblique pixel axes allowed, as in the paper's Table 1, where the method can."""
    return tuple(
        entry._replace(settings={**entry.settings, "skew": True}) if entry.takes("skew") else entry
        for entry in entries
    )


def own_entry(text: str) -> PaperEntry:
    """A method of the user's own, or one of METHODS with settings, as `--with` names it.

    Args:
        text: `module:function`, a function that takes detections and returns a calibration; or what `compare`
            takes, `fccm:brown:k1,k2`; either after `NAME=`.
    Raises:
        InputError: there is no such module, function, method or setting.
    """
    head, equals, tail = text.partition("=")
    name, what = (head, tail) if equals and ":" not in head else (text, text)
    if not name:
        raise InputError(
            f"--with {text!r} has no name before its '='; expected such as mine=module:function."
        )
    module, _, attribute = what.partition(":")
    if module in METHODS:
        entry = parse_entry(what)
        return PaperEntry(name, entry.method, entry.settings)
    try:
        function: Any = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(
            f"--with {text!r} names no method ({error}); expected module:function with a function that takes"
            f" detections, or one of {', '.join(METHODS)} as in fccm:brown:k1,k2."
        ) from error
    if not callable(function):
        raise InputError(f"--with {text!r} is {function!r}; expected a function that takes detections.")
    method: Any = function  # what it returns is seen when it has been called
    return PaperEntry(name if equals else attribute, method, {})
