"""Figures and tables of section 4 with what the paper claims about each, from the results of a run.

EXHIBITS lists the figures that are curves over a level; a figure more is an entry more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from orthoscope.paper.claims import about_curves, about_eq7
from orthoscope.paper.claims.about_curves import Axis, Judge
from orthoscope.paper.claims.claim import Claim
from orthoscope.paper.curves import Curves, curves_of
from orthoscope.paper.photographs import STUDY as PHOTOGRAPHS
from orthoscope.paper.section4 import PAPER_NOISE_PX, SCENES, Results
from orthoscope.paper.trials import Outcome

__all__ = [
    "FigureWithClaims",
    "eq7_claims",
    "fair_finding",
    "figures_with_claims",
    "on_photographs",
    "without_noise",
]


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
                about_curves.better_on_test,
                about_curves.better_repeated,
                about_curves.compensated,
                about_curves.same_on_test,
                about_curves.most_sensitive,
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
                about_curves.better_on_test,
                about_curves.better_repeated,
                about_curves.greatest_error,
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
            (about_curves.accurate_from_three, about_curves.fewer_than_three),
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
        about_curves.better_on_test,
        about_curves.better_repeated,
        about_curves.compensated,
        about_curves.same_on_test,
        about_curves.greatest_error,
        about_curves.better_trained,
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
        about_curves.exact_without_noise(
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
        about_eq7.determined(f"Eq. (8), {scene}", [m for m in results.members if m.scene == scene])
        for scene in SCENES
    )
    of_weights = (
        about_eq7.weights_do_not_matter(
            f"Section 3.1, {scene}", [m for m in results.members if m.scene == scene]
        )
        for scene in SCENES
    )
    return (about_eq7.perfect("Eq. (7)", results.members), *of_scenes, *of_weights)


def fair_finding(results: Results) -> str:
    """FCCM with 5 parameters against the paper's three, at the noise of figs. 4 and 5, all points."""
    curves = {scene: curves_of(results.outcomes, study="points", scene=scene) for scene in SCENES}
    return about_curves.fair_chance(
        curves,
        level=float(max(columns * rows for columns, rows in results.plan.points)),
        noise_px=PAPER_NOISE_PX,
    )
