"""Figures and tables of section 4 with what the paper claims about each, from the results of a run.

EXHIBITS lists the figures that are curves over a level; a figure more is an entry more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from orthoscope.geometry.arrays import ndarray
from orthoscope.paper import claims_about_curves, claims_about_eq7
from orthoscope.paper.claims import Claim, ClaimVerdict
from orthoscope.paper.claims_about_curves import Axis, Judge
from orthoscope.paper.curves import Curves, curves_of
from orthoscope.paper.entries import MLDC, PAPER
from orthoscope.paper.photographs import STUDY as PHOTOGRAPHS
from orthoscope.paper.photographs import obliqueness
from orthoscope.paper.section4 import PAPER_NOISE_PX, SCENES, Results
from orthoscope.paper.trials import Outcome
from orthoscope.paper.wording import each_of

__all__ = [
    "Centre",
    "FigureWithClaims",
    "ParameterColumn",
    "centres",
    "eq7_claims",
    "fair_finding",
    "figures_with_claims",
    "on_photographs",
    "parameter_columns",
    "stable_centre",
    "without_noise",
]

# A distortion centre that changes by less, pixels, from trial to trial is a stable one.
STEADY_PX = 2.0

NOISE = Axis("noise levels", "{:g} px of noise", column="noise_px", label="sigma (px)")
POINTS = Axis("numbers of points", "{:g} points", column="points", label="points a view")
IMAGES = Axis("numbers of images", "{:g} images", column="images", label="images")


@dataclass(frozen=True)
class Kind:
    """A figure before its numbers: what it shows of which study, the claims about it; then its file's name,
    the page's, and the scene.

    Attributes:
        even: levels at equal distances.
    """

    study: str
    title: str
    axis: Axis
    judges: tuple[Judge, ...]
    caption: str
    even: bool = False
    name: str = ""
    where: str = ""
    scene: str = ""


@dataclass(frozen=True, eq=False)
class FigureWithClaims:
    """A figure with its numbers and the claims about it."""

    kind: Kind
    curves: Curves
    claims: tuple[Claim, ...]


def _low_and_high(kind: Kind, low: tuple[str, str], high: tuple[str, str]) -> tuple[Kind, Kind]:
    """The same figure for low and for high distortion, each with its file's name and the page's."""
    first, second = (
        replace(kind, title=f"{kind.title}, {scene} distortion", scene=scene, name=name, where=where)
        for scene, (name, where) in zip(SCENES, (low, high), strict=True)
    )
    return first, second


EXHIBITS = (
    *_low_and_high(
        Kind(
            "noise",
            "NCE against pixel noise",
            NOISE,
            (
                claims_about_curves.better_on_test,
                claims_about_curves.better_repeated,
                claims_about_curves.compensated,
                claims_about_curves.same_on_test,
                claims_about_curves.most_sensitive,
            ),
            "Sigma is that of a board face on; noise grows with the tilt and is on training data only. 15"
            " training views. Bands: standard error.",
        ),
        ("fig2", "Fig. 2"),
        ("fig3", "Fig. 3"),
    ),
    *_low_and_high(
        Kind(
            "points",
            "NCE against the number of points",
            POINTS,
            (
                claims_about_curves.better_on_test,
                claims_about_curves.better_repeated,
                claims_about_curves.greatest_error,
            ),
            "Whole rows and columns spread over the board, always with the outermost ones; 15 views, sigma"
            " 0.1 px. Bands: standard error.",
            even=True,
        ),
        ("fig4", "Fig. 4"),
        ("fig5", "Fig. 5"),
    ),
    *_low_and_high(
        Kind(
            "images",
            "NCE against the number of images",
            IMAGES,
            (claims_about_curves.accurate_from_three, claims_about_curves.fewer_than_three),
            "The first so many of the 15 training views, sigma 0.1 px. One and two views need assumptions."
            " Bands: standard error.",
            even=True,
        ),
        ("images_low", "Images, low"),
        ("images_high", "Images, high"),
    ),
)

FIG6 = Kind(
    PHOTOGRAPHS,
    "NCE against the number of points, real photographs",
    POINTS,
    (
        claims_about_curves.better_on_test,
        claims_about_curves.better_repeated,
        claims_about_curves.compensated,
        claims_about_curves.same_on_test,
        claims_about_curves.greatest_error,
        claims_about_curves.better_trained,
    ),
    "Means over four splits; sub-grids as in figs. 4 and 5, tested on all points of the test photographs."
    " Bands: standard error.",
    even=True,
    name="fig6",
    where="Fig. 6",
    scene=PHOTOGRAPHS,
)


def figures_with_claims(results: Results) -> list[FigureWithClaims]:
    """The simulated figures that were run, in the paper's order."""
    made = [_exhibit(kind, results.outcomes) for kind in EXHIBITS]
    return [exhibit for exhibit in made if exhibit.curves]


def on_photographs(results: Results) -> FigureWithClaims | None:
    """Fig. 6; None without photographs."""
    return _exhibit(FIG6, results.on_photographs) if results.on_photographs else None


def _exhibit(kind: Kind, outcomes: Sequence[Outcome]) -> FigureWithClaims:
    curves = curves_of(outcomes, study=kind.study, scene=kind.scene)
    judges = kind.judges if curves else ()
    return FigureWithClaims(kind, curves, tuple(judge(kind.where, curves, kind.axis) for judge in judges))


def without_noise(results: Results) -> tuple[Claim, ...]:
    """What the paper says of few points without noise, in each scene."""
    return tuple(
        claims_about_curves.exact_without_noise(
            f"Section 4.1, {scene}", curves_of(results.outcomes, study="exact", scene=scene), POINTS
        )
        for scene in SCENES
        if results.plan.wants("exact", scene)
    )


def eq7_claims(results: Results) -> tuple[Claim, ...]:
    """What the paper says of eq. (7); nothing where it was not searched."""
    if not results.members:
        return ()
    of_scenes = (
        claims_about_eq7.determined(f"Eq. (8), {scene}", [m for m in results.members if m.scene == scene])
        for scene in SCENES
    )
    of_weights = (
        claims_about_eq7.weights_do_not_matter(
            f"Section 3.1, {scene}", [m for m in results.members if m.scene == scene]
        )
        for scene in SCENES
    )
    return (claims_about_eq7.perfect("Eq. (7)", results.members), *of_scenes, *of_weights)


@dataclass(frozen=True)
class Centre:
    """Where a method puts the distortion centre over the trials of a scene: means and standard deviations,
    pixels.
    """

    scene: str
    name: str
    trials: int
    x: tuple[float, float]
    y: tuple[float, float]


def centres(results: Results) -> list[Centre]:
    """Of every method that has a centre of its own, at the paper's noise and all points."""
    most = max((outcome.level for outcome in results.outcomes if outcome.study == "points"), default=0.0)
    found = []
    for scene in SCENES:
        chosen = [o for o in results.outcomes if (o.study, o.scene, o.level) == ("points", scene, most)]
        for name in dict.fromkeys(outcome.entry for outcome in chosen):
            of_entry = [o.judgement for o in chosen if o.entry == name and not o.judgement.failure]
            own = [j for j in of_entry if (j.centre_x, j.centre_y) != (j.cx, j.cy)]
            if own and len(own) == len(of_entry):
                x, y = np.array([(j.centre_x, j.centre_y) for j in own]).T
                found.append(Centre(scene, name, len(own), (_mean(x), _spread(x)), (_mean(y), _spread(y))))
    return found


def stable_centre(results: Results) -> tuple[Claim, ...]:
    """Whether MLDC's centre is the same over the trials, in each scene."""
    paper = "The method guarantees stability also when the distortion centre is computed."
    said = []
    for scene in SCENES:
        if not results.plan.wants("points", scene):
            continue
        of_scene = {centre.name: centre for centre in centres(results) if centre.scene == scene}
        where, mldc = f"Section 5, {scene}", of_scene.get(MLDC)
        spread = {name: max(centre.x[1], centre.y[1]) for name, centre in of_scene.items()}
        if mldc is None or not np.isfinite(spread[MLDC]):
            said.append(Claim(where, paper, ClaimVerdict.OPEN, "Fewer than two trials gave a centre."))
            continue
        verdict = ClaimVerdict.HOLDS if spread[MLDC] < STEADY_PX else ClaimVerdict.FAILS
        finding = (
            f"Over {mldc.trials} trials its centre is at ({mldc.x[0]:.1f}, {mldc.y[0]:.1f}) px; standard"
            " deviations of the"
            f" worse coordinate, px: {each_of(spread)}."
        )
        said.append(Claim(where, paper, verdict, finding))
    return tuple(said)


def fair_finding(results: Results) -> str:
    """FCCM with 5 parameters against the paper's three, at the noise of figs. 4 and 5, all points."""
    curves = {scene: curves_of(results.outcomes, study="points", scene=scene) for scene in SCENES}
    return claims_about_curves.fair_chance(
        curves,
        level=float(max(columns * rows for columns, rows in results.plan.points)),
        noise_px=PAPER_NOISE_PX,
    )


@dataclass(frozen=True)
class ParameterColumn:
    """A column of Table 1: mean errors, and of fx, fy, cu, cv (pixels) and gamma (degrees) mean and standard
    deviation over the splits.
    """

    name: str
    values: dict[str, tuple[float, float]]
    training_nce: float
    test_nce: float
    failures: int


def parameter_columns(results: Results) -> list[ParameterColumn]:
    """Table 1, from all points; the paper's three first."""
    most = max((outcome.level for outcome in results.on_photographs), default=0.0)
    whole = [outcome for outcome in results.on_photographs if outcome.level == most]
    names = list(dict.fromkeys([*(entry.name for entry in PAPER), *(outcome.entry for outcome in whole)]))
    return [_parameters(name, [outcome for outcome in whole if outcome.entry == name]) for name in names]


def _parameters(name: str, outcomes: Sequence[Outcome]) -> ParameterColumn:
    given = [outcome.judgement for outcome in outcomes if not outcome.judgement.failure]
    fx, fy, cx, cy, skew = np.array([(j.fx, j.fy, j.cx, j.cy, j.skew) for j in given]).reshape(-1, 5).T
    columns = {"fx": fx, "fy": fy, "cu": cx, "cv": cy, "gamma": obliqueness(fx, skew)}
    return ParameterColumn(
        name,
        {
            key: (_mean(column), float(column.std(ddof=1)) if len(column) > 1 else float("nan"))
            for key, column in columns.items()
        },
        _mean(np.array([j.training_nce for j in given])),
        _mean(np.array([j.test_nce for j in given])),
        len(outcomes) - len(given),
    )


def _spread(values: ndarray) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


def _mean(values: ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")
