"""What a verdict must say, scenario by scenario: one entry is a name, a recipe, how it is calibrated, and
what is right.

`grades` and `causes` are all that would be right.  Where the photographs leave it to chance how good the
camera becomes (few views, little tilt), more than one grade is right, and the rules that hold everywhere
(truth_table.py) judge the rest: nothing is called good whose true error is above a pixel or three times the
predicted one, nothing is thrown away that is good.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from benchmarks.studies.projectors import Projector
from benchmarks.studies.standing import Standing
from benchmarks.studies.worlds import Recipe

__all__ = ["SCENARIOS", "Scenario"]

GOOD, REGION, USABLE, NO = "good", "good within a region", "usable", "do not use"
ANY_GOOD = (GOOD, REGION)
NOT_GOOD = (USABLE, NO)
REFUSED = "refused"  # calibrate says that the photographs cannot tell a camera


@dataclass(frozen=True)
class Scenario:
    """One line of the truth table.

    Args:
        name: what it is, in words.
        recipe: the world.
        settings: of `calibrate`, beside its defaults.
        grades: those that are right.
        causes: those that are right; empty for none named.
        board: how the target is described where that is not the recipe's.
        groups: whether the verdict must name the photographs of each camera.
    """

    name: str
    recipe: Recipe
    settings: Mapping[str, Any] = field(default_factory=dict)
    grades: tuple[str, ...] = ANY_GOOD
    causes: tuple[str, ...] = ("", "region", "open")
    board: tuple[int, int, float] | None = None
    groups: bool = False


USUAL = Recipe()
FEW = ("", "region", "few", "open", "tilt")
FISHEYE = Projector(
    fisheye=True, focal=(215.0, 214.0), centre=(325.0, 237.0), coefficients=(0.03, -0.006, 0.001, -0.0002)
)
WIDE = Projector(
    fisheye=True, focal=(290.0, 289.0), centre=(325.0, 237.0), coefficients=(-0.02, 0.004, -0.001, 0.0)
)
TELE = Projector((1280, 960), (6000.0, 5990.0), (655.0, 470.0), (0.3, 0.0, 0.0, 0.0, 0.0))
LARGE = Projector((4000, 3000), (3300.0, 3296.0), (2022.0, 1489.0), (-0.12, 0.03, 0.0004, 0.0003, 0.0))
CROP = Projector((640, 480), (700.0, 699.0), (720.0, 520.0), (-0.1, 0.02, 0.0, 0.0, 0.0))
RATIONAL = Projector(coefficients=(0.35, -0.08, 0.0004, 0.0003, 0.002, 0.62, -0.05, 0.004))
PINHOLE = Projector(coefficients=(0.0, 0.0, 0.0, 0.0, 0.0))
DECENTRED = Projector(coefficients=(-0.22, 0.06, 0.006, -0.004, 0.0))
FLAT = {"method": "fccm"}


def _with(**changes: Any) -> Recipe:
    return replace(USUAL, **changes)


def _held(**changes: Any) -> Standing:
    return replace(USUAL.standing, **changes)


def _disagree(
    name: str, kind: str, amount: float, *, groups: bool = False, views: int = 20, **changes: Any
) -> Scenario:
    recipe = _with(cameras=(kind, amount), standing=_held(count=views), **changes)
    return Scenario(name, recipe, grades=NOT_GOOD, causes=("photographs",), groups=groups)


SCENARIOS: tuple[Scenario, ...] = (
    # Nothing is wrong.
    Scenario("perfect, 15 views", USUAL),
    Scenario("perfect, 30 views", _with(standing=_held(count=30))),
    Scenario("perfect, 8 views", _with(standing=_held(count=8)), grades=(*ANY_GOOD, USABLE), causes=FEW),
    Scenario("perfect, fccm", USUAL, FLAT),
    Scenario("perfect, corners .02 px", _with(noise=0.02)),
    Scenario(
        "perfect, corners .4 px, 30 views",
        _with(noise=0.4, standing=_held(count=30)),
        grades=(*ANY_GOOD, USABLE),
        causes=FEW,
    ),
    Scenario("no distortion", _with(camera=PINHOLE)),
    Scenario("rational lens", _with(camera=RATIONAL)),
    Scenario("wide lens, 120 degrees", _with(camera=WIDE, standing=_held(count=20))),
    Scenario("fisheye, 170 degrees", _with(camera=FISHEYE, standing=_held(count=20, fill=(0.3, 0.6)))),
    Scenario(
        "twelve megapixels",
        _with(camera=LARGE, noise=0.3, standing=_held(count=20)),
        grades=(*ANY_GOOD, USABLE),
        causes=FEW,
    ),
    Scenario(
        "large board, parts of it seen",
        _with(board=(14, 10, 0.02), standing=_held(seen=0.35, fill=(0.7, 1.3), reach=1.0)),
    ),
    Scenario(
        "crop, axis outside the frame",
        _with(camera=CROP, standing=_held(count=20)),
        grades=(GOOD, REGION, USABLE),
        causes=FEW,
    ),
    Scenario(
        "long focal length",
        _with(camera=TELE, standing=_held(count=20)),
        grades=(GOOD, REGION, USABLE),
        causes=FEW,
    ),
    Scenario("heavy-tailed corners", _with(tails=3.0)),
    # The photographs are too few or too much alike.
    Scenario("one view", _with(standing=_held(count=1)), grades=(NO,), causes=("few",)),
    Scenario(
        "two views", _with(standing=_held(count=2)), grades=(NO, USABLE, REFUSED), causes=("few", REFUSED)
    ),
    Scenario("three views", _with(standing=_held(count=3)), grades=(NO, USABLE), causes=("few",)),
    Scenario("five views", _with(standing=_held(count=5)), grades=(*ANY_GOOD, *NOT_GOOD), causes=FEW),
    Scenario(
        "board in the middle only",
        _with(standing=_held(reach=0.15, fill=(0.25, 0.4))),
        grades=(REGION, USABLE),
        causes=FEW,
    ),
    Scenario(
        "left half only",
        _with(standing=_held(reach=0.4, middle=(0.27, 0.5), fill=(0.25, 0.4))),
        grades=(REGION, USABLE),
        causes=FEW,
    ),
    Scenario("frontal", _with(standing=_held(tilt=(0.0, 2.0))), grades=(*ANY_GOOD, *NOT_GOOD), causes=FEW),
    Scenario(
        "frontal and central",
        _with(standing=_held(tilt=(0.0, 1.5), reach=0.1, fill=(0.25, 0.4))),
        grades=(*NOT_GOOD, REFUSED),
        causes=("tilt", "open", REFUSED),
    ),
    Scenario(
        "five poses, each six times",
        _with(standing=_held(count=5), detectors=(("copied", 6),)),
        grades=(REGION, USABLE, NO),
        causes=FEW,
    ),
    Scenario(
        "seven views, little tilt",
        _with(standing=_held(count=7, tilt=(3.0, 15.0))),
        grades=(GOOD, REGION, USABLE),
        causes=FEW,
    ),
    # The target is not what it is said to be; the default finds its shape, fccm takes it as said.
    Scenario("bent by 1.2 % of its size", _with(shape={"bend": 0.012})),
    Scenario("sagging", _with(shape={"sag": 0.004})),
    Scenario("wavy paper", _with(shape={"wave": 0.002}, standing=_held(count=20))),
    Scenario("stretched by 1 %", _with(shape={"stretch": 0.01})),
    Scenario(
        "stretched by .2 %, always upright",
        _with(shape={"stretch": 0.002}, standing=_held(roll=3.0)),
        grades=(GOOD, REGION, USABLE),
    ),
    Scenario("every corner elsewhere", _with(shape={"singles": 0.0006}, standing=_held(count=20))),
    Scenario("bent, fccm", _with(shape={"bend": 0.012}), FLAT, NOT_GOOD, ("target",)),
    Scenario("dented, fccm", _with(shape={"dent": 0.006}), FLAT, NOT_GOOD, ("target",)),
    Scenario("wavy, fccm", _with(shape={"wave": 0.006}), FLAT, NOT_GOOD, ("target",)),
    Scenario("stretched by 2 %, fccm", _with(shape={"stretch": 0.02}), FLAT, NOT_GOOD, ("target",)),
    Scenario(
        "bends from view to view",
        _with(bending=0.0006, standing=_held(count=20)),
        grades=(GOOD, REGION, USABLE),
        causes=FEW,
    ),
    Scenario(
        "errors alike within a view", _with(noise=0.05, alike=0.1), grades=(GOOD, REGION, USABLE), causes=FEW
    ),
    # The formula cannot follow the lens.
    Scenario(
        "decentering left out", _with(camera=DECENTRED), {**FLAT, "lens": "brown:k1,k2"}, NOT_GOOD, ("lens",)
    ),
    Scenario(
        "one coefficient",
        _with(camera=RATIONAL),
        {**FLAT, "lens": "brown:k1"},
        (*ANY_GOOD, *NOT_GOOD),
        ("lens",),
    ),
    Scenario(
        "division formula, lens decentred",
        _with(camera=DECENTRED),
        {**FLAT, "lens": "division"},
        NOT_GOOD,
        ("lens",),
    ),
    Scenario(
        "brown on a lens of 120 degrees",
        _with(camera=WIDE, standing=_held(count=20)),
        {**FLAT, "lens": "brown"},
        (*ANY_GOOD, *NOT_GOOD),
        ("lens",),
    ),
    Scenario(
        "brown on a fisheye",
        _with(camera=FISHEYE, standing=_held(count=20, fill=(0.3, 0.6))),
        {**FLAT, "lens": "brown"},
        (*NOT_GOOD, REFUSED),
        ("lens", REFUSED),
    ),
    # The photographs do not agree on one camera.
    _disagree("zoomed by 15 %", "zoom", 0.15, groups=True),
    _disagree("zoomed by 2 %", "zoom", 0.02, groups=True),
    _disagree("another camera, axis 1.5 % aside", "other", 0.015, groups=True),
    _disagree("straightened copies among them", "copies", 0.0, groups=True, views=12),
    _disagree("telephone turned over", "turned", 0.0, groups=True),
    _disagree("two lenses", "lenses", 0.4, groups=True),
    _disagree("focus by 1 % in every view", "breathing", 0.01),
    _disagree("stabiliser, 5 px", "stabiliser", 5.0),
    Scenario(
        "focus by .1 % in every view",
        _with(cameras=("breathing", 0.001), standing=_held(count=20)),
        grades=(GOOD, REGION, USABLE),
        causes=(*FEW, "photographs"),
    ),
    Scenario(
        "rolling shutter, slow",
        _with(shutter=0.001, standing=_held(count=20)),
        grades=(GOOD, REGION, USABLE),
        causes=(*FEW, "photographs"),
    ),
    Scenario(
        "rolling shutter, fast",
        _with(shutter=0.01, standing=_held(count=20)),
        grades=NOT_GOOD,
        causes=("photographs",),
    ),
    # Corners and photographs that do not belong.
    Scenario("1 % wild corners", _with(detectors=(("wild", 0.01),))),
    Scenario("5 % wild corners", _with(detectors=(("wild", 0.05),))),
    Scenario(
        "20 % wild corners",
        _with(detectors=(("wild", 0.2),), standing=_held(count=20)),
        grades=(GOOD, REGION, USABLE),
        causes=(*FEW, "views"),
    ),
    Scenario(
        "5 % wild corners, fccm",
        _with(detectors=(("wild", 0.05),)),
        FLAT,
        (GOOD, REGION, USABLE, NO, REFUSED),
        (*FEW, "corners", REFUSED),
    ),
    Scenario("one view found a row too low", _with(detectors=(("shifted", 1),))),
    Scenario("one view column by column", _with(detectors=(("transposed", 1),))),
    Scenario("one view in no order", _with(detectors=(("shuffled", 1),))),
    Scenario(
        "one view blurred",
        _with(detectors=(("blurred", 1),)),
        causes=("", "region", "open", "views"),
        grades=(GOOD, REGION, USABLE),
    ),
    Scenario(
        "one view of another board",
        _with(detectors=(("another board", 1),)),
        causes=("", "region", "open", "views"),
        grades=(GOOD, REGION, USABLE),
    ),
    Scenario(
        "a third upside down, board alike both ways",
        _with(board=(8, 6, 0.025), detectors=(("upside down", 5),)),
    ),
    Scenario(
        "all views column by column",
        _with(detectors=(("transposed", 15),)),
        grades=(REFUSED, NO),
        causes=(REFUSED, "target", "lens", "open"),
    ),
    # Where no formula is meant for it.
    Scenario(
        "under water, flat window",
        _with(camera=Projector(port=0.01), standing=_held(count=20)),
        grades=(GOOD, REGION, USABLE),
        causes=(*FEW, "photographs"),
    ),
)
