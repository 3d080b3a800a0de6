"""All of section 4 as one HTML page that needs no network.

The text is paper.html.jinja, in the report's style (report/page.css) with paper.css; figures go in as SVG,
photographs as data URIs. What the page concludes are findings (claims.py); nothing here or in the template
knows how an experiment ends. The same results give the same bytes; times alone are no seed's.
"""

from __future__ import annotations

import re
from functools import cache, partial
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from orthoscope.geometry.numbers import ABSENT, fixed, with_error
from orthoscope.methods import METHODS
from orthoscope.paper.claims.claim import Claim, ClaimVerdict, main_headline, of_sentence
from orthoscope.paper.claims.in_figures import (
    FigureWithClaims,
    eq7_claims,
    fair_finding,
    figures_with_claims,
    on_photographs,
    without_noise,
)
from orthoscope.paper.claims.in_tables import (
    ParameterColumn,
    centres,
    parameter_columns,
    stable_centre,
    step_two_claims,
    step_two_rows,
    straightened_claims,
    time_claims,
)
from orthoscope.paper.claims.sentences import Sentence
from orthoscope.paper.curves import curves_of
from orthoscope.paper.entries import PAPER
from orthoscope.paper.first_figure import FirstFigure
from orthoscope.paper.photographs import SPLIT_COUNT, Straightened
from orthoscope.paper.section4 import PAPER_NOISE_PX, SCENES, Results
from orthoscope.paper.trials import TEST_VIEWS, TRAINING_VIEWS
from orthoscope.report.html import raw
from orthoscope.report.page import closed_page
from orthoscope.version import __version__

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = ["paper_page"]

# The paper's gamma is told with so many decimals.
GAMMA_DECIMALS = 3
# The signs of the markers in a legend.
SIGNS = dict(zip("os^vPDX*hd><p", "●■▲▼✚◆✖★⬢♦▶◀⬟", strict=True))


class Cell(NamedTuple):
    """An error of a table: its text, and whether it is the least of its column."""

    text: str
    best: bool = False


def paper_page(
    results: Results, *, straightened: Straightened | None = None, first: FirstFigure | None = None
) -> str:
    """The page as text.

    Args:
        results: of a run.
        straightened: Fig. 7, where there are photographs.
        first: Fig. 1.
    """
    shown, real = figures_with_claims(results), on_photographs(results)
    summary = _summary(every_claim(results))
    verdicts = [of_sentence(claims) for _, claims in summary]
    body = _template().render(
        version=__version__,
        plan=results.plan,
        training_views=TRAINING_VIEWS,
        test_views=TEST_VIEWS,
        splits=SPLIT_COUNT,
        noise=PAPER_NOISE_PX,
        headline=main_headline(every_claim(results)),
        summary=summary,
        counts=[
            (verdict.value, number, _tone(verdict))
            for verdict in ClaimVerdict
            if (number := verdicts.count(verdict))
        ],
        sentences=len(verdicts),
        fig1=_fig1(first),
        centres=_centres(results),
        stable=stable_centre(results),
        step_two=[
            (r.scene, r.name, f"{r.steps:.0f}", _nce(r.test_nce), *(fixed(c, 1) for c in r.centre))
            for r in step_two_rows(results)
        ],
        of_step_two=step_two_claims(results),
        timings=[(t.images, t.entry, t.unknowns, fixed(t.seconds, 2), t.steps) for t in results.timings],
        of_times=time_claims(results),
        printed=[entry.name for entry in PAPER],
        failures=_failures(results),
        tone=_tone,
        figures=[_figure(exhibit) for exhibit in shown],
        without_noise=without_noise(results),
        eq7=eq7_claims(results),
        members=_members(results),
        fair=fair_finding(results),
        lenses=_lenses(results),
        real=_figure(real) if real else None,
        detections=results.detections,
        fig7=_fig7(straightened),
        of_fig7=straightened_claims(results),
        parameters=_parameters(parameter_columns(results)) if real else [],
    )
    style = files("orthoscope.paper").joinpath("paper.css").read_text("utf-8")
    return closed_page("The paper's experiments", [raw(body)], version=__version__, style=style)


def every_claim(results: Results) -> list[Claim]:
    """All that is judged of a run."""
    real = on_photographs(results)
    exhibits = (*figures_with_claims(results), *([real] if real else []))
    tables = (without_noise, eq7_claims, stable_centre, step_two_claims, time_claims, straightened_claims)
    return [claim for exhibit in exhibits for claim in exhibit.claims] + [
        claim for table in tables for claim in table(results)
    ]


@cache
def _template() -> Template:
    """The page's template, everything escaped that is put into it; imported late, as in report/page.py."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("orthoscope", "paper"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("paper.html.jinja")


def _figure(exhibit: FigureWithClaims) -> dict[str, Any]:
    """What the template needs of a figure; matplotlib is imported late, since it takes its time."""
    from markupsafe import Markup

    from orthoscope.paper.figures import looks, nce_figure
    from orthoscope.report.figures import to_svg

    kind = exhibit.kind
    panels = {
        of: nce_figure(exhibit.curves, of=of, title=title, level=kind.axis.label, even=kind.even)
        for of, title in (("training_nce", "NCE, training data"), ("test_nce", "NCE, test data"))
    }
    return {
        "name": kind.name,
        "where": kind.where,
        "title": kind.title,
        "caption": kind.caption,
        "svgs": [Markup(_without_styles(to_svg(drawn, f"{kind.name}-{of}"))) for of, drawn in panels.items()],
        "looks": [(look, SIGNS[look.marker]) for look in looks(tuple(exhibit.curves))],
        "claims": exhibit.claims,
    }


def _without_styles(svg: str) -> str:
    """The same drawing with attributes in the place of styles, which the page's policy forbids; its type is
    the sheet's.
    """

    def attributes(found: re.Match[str]) -> str:
        pairs = [part.partition(":") for part in found[1].split(";") if part.strip()]
        return "".join(
            f' {name.strip()}="{value.strip()}"' for name, _, value in pairs if name.strip() != "font-family"
        )

    return re.sub(r' style="([^"]*)"', attributes, svg)


def _fig1(first: FirstFigure | None) -> dict[str, Any] | None:
    """The photograph and both kinds of points, with a border wide enough for all."""
    if first is None:
        return None
    from orthoscope.report.pictures import BYTES_OF_LARGE, LARGE_WIDTH, picture_uri

    height, width = first.photograph.shape[:2]
    corners = np.concatenate([first.corrected, [[0.0, 0.0], [width, height]]])
    low, high = np.floor(corners.min(0) - 6), np.ceil(corners.max(0) + 6)
    pairs = zip(first.detected.tolist(), first.corrected.tolist(), strict=True)
    return {
        "name": first.name,
        "rendered": first.rendered,
        "photograph": picture_uri(first.photograph, LARGE_WIDTH, BYTES_OF_LARGE),
        "size": (width, height),
        "box": " ".join(f"{value:.0f}" for value in (*low, *(high - low))),
        "pairs": [[f"{value:.2f}" for value in (*one, *other)] for one, other in pairs],
        "farthest": fixed(float(np.hypot(*(first.corrected - first.detected).T).max()), 1),
    }


def _fig7(straightened: Straightened | None) -> dict[str, Any] | None:
    if straightened is None:
        return None
    from orthoscope.report.pictures import BYTES_OF_LARGE, LARGE_WIDTH, picture_uri

    return {
        "name": straightened.name,
        "photograph": picture_uri(straightened.photograph, LARGE_WIDTH, BYTES_OF_LARGE),
        "pictures": [
            (
                (name, None, picture)
                if isinstance(picture, str)
                else (name, picture_uri(picture, LARGE_WIDTH, BYTES_OF_LARGE), "")
            )
            for name, picture in straightened.pictures
        ],
    }


def _summary(every: list[Claim]) -> list[tuple[Sentence, list[Claim]]]:
    """Claims by what the paper says, which it may say of several figures."""
    return [
        (sentence, [claim for claim in every if claim.paper == sentence])
        for sentence in dict.fromkeys(claim.paper for claim in every)
    ]


def _centres(results: Results) -> list[tuple[str, str, int, str, str]]:
    """The distortion centre over trials: scene, method, trials, x and y."""
    return [(c.scene, c.name, c.trials, _with_spread(c.x), _with_spread(c.y)) for c in centres(results)]


def _with_spread(pair: tuple[float, float], decimals: int = 2) -> str:
    return with_error(*pair, alone=partial(fixed, decimals=decimals))


def _tone(verdict: ClaimVerdict) -> str:
    """The class of a verdict's chip."""
    return verdict.name.lower()


def _failures(results: Results) -> list[tuple[str, str, str]]:
    """Contenders whose trials gave no camera: name and study, how many of how many, and the first one's
    reason.
    """
    groups: dict[tuple[str, str, str], list[str]] = {}
    for outcome in (*results.outcomes, *results.on_photographs):
        groups.setdefault((outcome.entry, outcome.study, outcome.scene), []).append(outcome.judgement.failure)
    rows = []
    for (entry, study, scene), reasons in groups.items():
        failed = [reason for reason in reasons if reason]
        if failed:
            where = study if study == scene else f"{study}, {scene}"
            rows.append((f"{entry} ({where})", f"{len(failed)} of {len(reasons)}", failed[0]))
    return rows


def _members(results: Results) -> list[tuple[str, list[list[str]]]]:
    """The table of eq. (7) for each scene: search, J, fx, fy, cx, cy, test NCE."""
    return [
        (
            scene,
            [
                [
                    (f"eq. (7), {m.name}" if m.literal else m.name),
                    f"{m.J:.0e}" if m.literal else ABSENT,
                    *(fixed(value, 1) for value in m.judgement[2:6]),
                    _nce(m.judgement.test_nce),
                ]
                for m in results.members
                if m.scene == scene
            ],
        )
        for scene in SCENES
    ]


def _lenses(results: Results) -> list[tuple[str, str, list[Cell], str]]:
    """Every method with every lens: method, lens, training and test NCE in each scene, failures."""
    curves = {scene: curves_of(results.outcomes, study="lenses", scene=scene) for scene in SCENES}
    if not all(curves.values()):
        return []
    pairs = [(method, lens, f"{method} {lens}") for method in METHODS for lens in results.plan.lenses]
    pairs = [pair for pair in pairs if pair[2] in curves[SCENES[0]]]
    columns = [(curves[scene], of) for scene in SCENES for of in ("training_nce", "test_nce")]
    values = np.array(
        [[float(getattr(of_scene[name], of)[0]) for of_scene, of in columns] for *_, name in pairs]
    )
    least = np.nanmin(np.where(np.isfinite(values), values, np.inf), axis=0)
    rows = []
    for (method, lens, name), row in zip(pairs, values, strict=True):
        failed = [curves[scene][name] for scene in SCENES]
        failures = f"{sum(int(c.failures[0]) for c in failed)} of {sum(int(c.trials[0]) for c in failed)}"
        rows.append(
            (
                method,
                lens,
                [Cell(_nce(value), bool(value == best)) for value, best in zip(row, least, strict=True)],
                failures,
            )
        )
    return rows


def _parameters(table: list[ParameterColumn]) -> list[tuple[str, list[str]]]:
    """Table 1 turned over, so that it fits a page: a row for each method, the names of the numbers first."""
    decimals = {"fx": 2, "fy": 2, "cu": 2, "cv": 2, "gamma": GAMMA_DECIMALS}
    units = [f"{key} ({'deg' if key == 'gamma' else 'px'})" for key in decimals]
    return [("", [*units, "training NCE", "test NCE", "no camera"])] + [
        (
            column.name,
            [
                *(_with_spread(column.values[key], digits) for key, digits in decimals.items()),
                _nce(column.training_nce),
                _nce(column.test_nce),
                str(column.failures),
            ],
        )
        for column in table
    ]


def _nce(value: float) -> str:
    return ABSENT if not np.isfinite(value) else f"{value:.3f}" if value < 10 else f"{value:.1f}"
