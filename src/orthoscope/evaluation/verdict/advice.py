"""What to do about it: for each cause the first that applies, as data.

An advice that names an option says which, so that a test can ask whether the command line has it, and applies
only where that is not what was done.  The last of each cause names none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from orthoscope.evaluation.verdict.situation import Situation

__all__ = ["ADVICE", "Advice", "advice_on"]


class Advice(NamedTuple):
    """Something that a user can do.

    Attributes:
        cause: what it is against; empty where nothing is wrong.
        says: the sentence.
        when: whether it applies.
        options: of `calibrate`, with their values, that it asks for.
    """

    cause: str
    says: Callable[[Situation], str]
    when: Callable[[Situation], bool] = lambda s: True
    options: tuple[tuple[str, str], ...] = ()


def _plain(text: str) -> Callable[[Situation], str]:
    return lambda s: text


def _of_default(s: Situation) -> bool:
    return s.method == "decoupled"


ADVICE: tuple[Advice, ...] = (
    Advice(
        "few",
        lambda s: f"Take {max(3, 15 - s.distinct)} more photographs, the target tilted another way in each.",
    ),
    Advice(
        "unknown",
        _plain("Calibrate with --method decoupled."),
        lambda s: not _of_default(s),
        (("--method", "decoupled"),),
    ),
    Advice(
        "unknown",
        _plain("Check that the target is what was said and that its corners were found where they are."),
    ),
    Advice(
        "photographs",
        _plain("Put the photographs of each camera into a folder of its own and calibrate them one by one."),
        lambda s: bool(s.groups),
    ),
    Advice(
        "photographs",
        _plain("Fix zoom and focus, switch autofocus off, and take them again."),
        lambda s: s.disagree == "zoom",
    ),
    Advice(
        "photographs",
        _plain("Switch stabiliser and cropping off, and take them again."),
        lambda s: s.disagree == "centre",
    ),
    Advice(
        "photographs",
        _plain("Use photographs of one lens only, as the camera wrote them."),
        lambda s: s.disagree == "lens",
    ),
    Advice(
        "photographs",
        _plain("Fix zoom and focus, keep camera and target still, and take them again."),
        lambda s: s.disagree == "mixed",
    ),
    Advice("photographs", _plain("Put the camera on a stand, keep the target still, and take them again.")),
    Advice(
        "lens",
        _plain("Calibrate with the default method, whose lens follows no formula: --method decoupled."),
        lambda s: not _of_default(s),
        (("--method", "decoupled"),),
    ),
    Advice(
        "lens",
        _plain("Let the lens be free of formulas: --lens free."),
        lambda s: _of_default(s) and s.lens not in ("free", "auto"),
        (("--lens", "free"),),
    ),
    Advice("lens", _plain("Take more photographs that fill the frame to its border.")),
    Advice(
        "target",
        _plain("Let its shape be found: --method decoupled."),
        lambda s: not _of_default(s) and s.shape == "flat",
        (("--method", "decoupled"),),
    ),
    Advice(
        "target",
        _plain("Let every corner have its own place: --shape free."),
        lambda s: _of_default(s) and s.shape != "free",
        (("--shape", "free"),),
    ),
    Advice(
        "target",
        _plain(
            "Fix it to something stiff, so that it does not bend between photographs, and take them again."
        ),
    ),
    Advice(
        "corners",
        _plain("Leave them out as the default method does: --method decoupled."),
        lambda s: not _of_default(s),
        (("--method", "decoupled"),),
    ),
    Advice("corners", _plain("Look at the photographs that they are in.")),
    Advice(
        "solver",
        _plain(
            "Take photographs again with the target larger in the frame and tilted in different directions."
        ),
    ),
    Advice("tilt", _plain("Take ten more with the target tilted by 30 to 45 degrees, another way in each.")),
    Advice(
        "open",
        _plain("Take sharper photographs: hold camera and target still, in more light."),
        lambda s: s.noise_px > 0.5,
    ),
    Advice(
        "open",
        lambda s: (
            f"Take ten more, the target large in the frame and tilted by 30 to 45 degrees, some {s.place}."
        ),
    ),
    Advice("views", lambda s: f"Look at {s.suspects[0][0]}, and take it again or leave it out."),
    Advice("region", lambda s: f"Next, photograph the target {s.place}."),
    Advice(
        "",
        lambda s: (
            f"Nothing shows the frame {s.precious[0][1]} as {s.precious[0][0]} does: take another like it."
        ),
        lambda s: bool(s.precious),
    ),
)


def advice_on(cause: str, s: Situation) -> Advice | None:
    """What to do about a cause; None where there is nothing to do."""
    return next((advice for advice in ADVICE if advice.cause == cause and advice.when(s)), None)
