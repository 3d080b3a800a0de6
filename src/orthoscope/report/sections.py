"""The page's parts in words and tables, from top to bottom; each an element.

What the script draws has its place here, an element with `data-panel`, and stays hidden where there is no
script.
"""

from __future__ import annotations

from typing import Any

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.geometry.numbers import ABSENT, percent, pixels
from orthoscope.report import tables
from orthoscope.report.data.views import suspects_of
from orthoscope.report.drawn_corners import drawn_corners
from orthoscope.report.headline import headline, next_steps
from orthoscope.report.html import Html, table, tag, unbroken
from orthoscope.report.panels import PANELS
from orthoscope.report.pictures import Pictures
from orthoscope.report.shape import shape_rows
from orthoscope.report.snippets import snippets
from orthoscope.targets.detections import Detections

__all__ = [
    "before_and_after_section",
    "closing",
    "figure",
    "figures",
    "first_screen",
    "key_figures",
    "numbers_section",
    "opening",
    "photographs_section",
    "set_aside",
    "what_to_know",
]

MISFIT_HEADINGS = (
    "misfit of",
    "same in every view (px)",
    "differs (px)",
    "F",
    "F by chance",
    "p",
    "p over views",
    "moves the image by (px)",
)
LEAVE_OUT = tag("input", type="checkbox", class_="leave-out")
TRUST = "The predicted error of the camera over the frame, and the region where it may be used"


def opening(evaluation: Evaluation) -> Html:
    """The verdict, and what was calibrated from what."""
    calibration, told = evaluation.calibration, headline(evaluation)
    detections = calibration.detections
    width, height = detections.image_size
    facts = (
        f"{_count(len(detections.views), 'photograph')} of {detections.target.name} · {width} × {height}"
        f" pixels · lens {tables.lens_in_words(calibration.camera)} · method {calibration.method}"
    )
    grade = tag("span", tag("span", told.sign, aria_hidden="true"), " ", told.grade, class_="grade")
    return tag(
        "header",
        tag("p", "orthoscope · calibration report", class_="kicker"),
        tag("h1", grade, " ", tag("span", unbroken(told.sentence))),
        tag("p", told.limit, class_="limit") if told.limit else None,
        tag("p", facts, class_="facts"),
        class_=f"grade-{told.look}",
    )


def first_screen(evaluation: Evaluation, trusted: Any, pictures: Pictures) -> Html:
    """Where the camera may be trusted, the camera to be copied, and what to do next."""
    return tag(
        "section",
        _trust(trusted, pictures),
        tag("div", _camera(evaluation), _next(evaluation), class_="stack"),
        class_="first no-map" if isinstance(trusted, str) else "first",
        aria_label="The camera",
    )


def _trust(trusted: Any, pictures: Pictures) -> Html:
    title = "Where it may be trusted"
    if isinstance(trusted, str):
        return _empty("trust", title, trusted)
    share = "" if trusted["share"] is None else f", {percent(trusted['share'])} of the frame,"
    where = f"Within the line{share} the camera may be used."
    if trusted["share"] == 0.0:
        where = f"It is more than {trusted['limit']:g} px everywhere."
    caption = f"Colour: predicted error in pixels. {where}"
    return figure("trust", title, caption, TRUST)


def _camera(evaluation: Evaluation) -> Html:
    """K and the lens, by tool, with a button that copies them."""
    told = snippets(evaluation.calibration)
    tabs = [
        tag(
            "button",
            one.tool,
            role="tab",
            type="button",
            id=f"tab-{i}",
            aria_controls=f"copy-{i}",
            aria_selected="true" if i == 0 else "false",
            tabindex=0 if i == 0 else -1,
        )
        for i, one in enumerate(told)
    ]
    texts = [
        tag(
            "div",
            tag("pre", tag("code", one.text), tabindex=0) if one.text else None,
            tag("p", one.remark, class_="note") if one.remark else None,
            role="tabpanel",
            id=f"copy-{i}",
            aria_labelledby=f"tab-{i}",
            hidden=i > 0,
        )
        for i, one in enumerate(told)
    ]
    return tag(
        "div",
        tag("h2", "K and lens"),
        tag("p", unbroken(tables.camera_line(evaluation.calibration)), class_="camera-line"),
        tag(
            "div",
            tag("div", tabs, role="tablist", aria_label="Camera for"),
            tag("button", "Copy", type="button", class_="copy"),
            class_="tabs",
        ),
        texts,
        class_="panel camera",
    )


def _next(evaluation: Evaluation) -> Html:
    steps = [tag("li", step) for step in next_steps(evaluation)]
    use = [
        tag("li", "Straight pictures: ", tag("code", "orthoscope undistort calibration.json PHOTOS")),
        tag("li", "For another tool: ", tag("code", "orthoscope export calibration.json --to TOOL")),
    ]
    return tag("div", tag("h2", "What to do next"), tag("ul", steps, use), class_="panel next")


def key_figures(evaluation: Evaluation) -> Html:
    """The figures that stand for all others."""
    cards = [
        tag(
            "div",
            tag("h2", card.label),
            tag(
                "p",
                card.value,
                tag("span", f" {card.unit}", class_="unit") if card.unit else None,
                class_="value",
            ),
            tag("p", card.note, class_="note"),
            class_="card",
        )
        for card in tables.cards(evaluation)
    ]
    return tag("section", cards, class_="cards", aria_label="Key figures")


def what_to_know(evaluation: Evaluation) -> Html | None:
    """Warnings, views that do not belong, assumptions; nothing where there are none."""
    suspects = [f"{image}: {reason}" for image, reason in suspects_of(evaluation).items()]
    lists = {
        "Warnings": ("warnings", tables.warnings(evaluation)),
        "Suspect photographs": ("suspects", suspects),
        "Assumptions": ("assumptions", list(evaluation.calibration.assumptions)),
    }
    told = [
        [tag("h3", title), tag("ul", [tag("li", sentence) for sentence in sentences], class_=kind)]
        for title, (kind, sentences) in lists.items()
        if sentences
    ]
    return tag("section", tag("h2", "What to know"), told, class_="panel") if told else None


def photographs_section(evaluation: Evaluation, pictures: Pictures) -> Html:
    """Each photograph with its errors; opened, with corners and residuals; a switch takes it out."""
    shots, detections = [], evaluation.calibration.detections
    for row in tables.view_rows(evaluation):
        uri = pictures.small.get(row.image)
        picture = (
            tag("img", src=uri, alt="", loading="lazy")
            if uri
            else drawn_corners(detections.views[row.number - 1], detections.image_size)
        )
        shots.append(
            tag(
                "li",
                _opener(row, picture),
                tag("p", row.image, class_="name", title=row.image),
                tag("p", f"{row.corners} corners · {_errors(row)}", class_="note"),
                tag("p", row.suspicion, class_="suspicion") if row.suspicion else None,
                tag("label", LEAVE_OUT, " leave out", class_="switch script"),
                class_="shot suspect" if row.suspicion else "shot",
                data_view=row.number - 1,
            )
        )
    order = [
        tag("option", words, value=key)
        for key, words in (("order", "in order"), ("error", "largest error first"))
    ]
    return tag(
        "section",
        tag(
            "div",
            tag("h2", "Photographs"),
            tag("label", "sorted ", tag("select", order, id="sort"), class_="script"),
            class_="bar",
        ),
        tag(
            "p",
            "Open one to see its corners where they were found and where the camera predicts them.",
            class_="note",
        ),
        _not_shown(len(shots) - len(pictures.small)),
        tag("ol", shots, class_="shots"),
        class_="panel",
    )


def _not_shown(views: int) -> Html | None:
    """What stands for photographs that are not shown, and how to have them shown."""
    if views <= 0:
        return None
    words = "Corners alone stand for a frame of a film, and for a photograph that was not at hand:"
    command = tag("code", "orthoscope report calibration.json --photos PHOTOS")
    return tag("p", f"{words} ", command, " shows it.", class_="note")


def _opener(row: tables.ViewRow, picture: Html) -> Html:
    number, label = (
        tag("span", f"{row.number}", class_="number"),
        f"Photograph {row.number}, {row.image}: open",
    )
    return tag("button", picture, number, type="button", class_="open", aria_label=label)


def _errors(row: tables.ViewRow) -> str:
    held_out = "" if row.held_out_rms == ABSENT else f" · held out {row.held_out_rms} px"
    return f"{row.rms} px{held_out}"


def figures(found: dict[str, Any]) -> Html:
    """All panels, or why one has nothing to show."""
    drawn = [
        figure(panel.name, panel.title, panel.caption, panel.label, wide=panel.wide)
        for panel in PANELS
        if not isinstance(found[panel.name], str)
    ]
    empty = [
        _empty(panel.name, panel.title, found[panel.name])
        for panel in PANELS
        if isinstance(found[panel.name], str)
    ]
    return tag("section", drawn, tag("div", empty, class_="empties") if empty else None, class_="plates")


def figure(name: str, title: str, caption: str, label: str, *, wide: bool = False) -> Html:
    """The place of a figure that the script draws.

    Args:
        name: of the figure, as the script knows it.
        label: what it shows, for readers who hear the page.
        wide: it spans both columns.
    """
    return tag(
        "figure",
        tag("div", tag("h2", title), tag("div", class_="controls script"), class_="bar"),
        tag("div", tag("canvas", role="img", tabindex=0, aria_label=label), class_="stage script"),
        tag("figcaption", caption),
        id=name,
        class_="wide" if wide else None,
        data_panel=name,
    )


def _empty(name: str, title: str, why: str) -> Html:
    return tag("div", tag("h2", title), tag("p", why, class_="note"), id=name, class_="panel empty")


def before_and_after_section(pictures: Pictures) -> Html | None:
    """One photograph as it was taken, and straight."""
    if pictures.large is None:
        return None
    name, before, after = pictures.large
    pair = [
        tag("div", tag("img", src=uri, alt=f"{name} {words}", id=which), tag("p", words))
        for uri, words, which in (
            (before, "as it was taken", "before"),
            (after, "without lens distortion", "after"),
        )
    ]
    return tag(
        "section",
        tag("h2", f"Before and after: {name}"),
        tag("div", pair, class_="pair"),
        tag("p", "Lines that are straight in the world are straight on the right.", class_="note"),
        class_="panel",
    )


def numbers_section(evaluation: Evaluation) -> Html:
    """Parameters, lens, target and misfits as tables."""
    calibration = evaluation.calibration
    parameters = [
        (row.name, tag("span", row.value, title=row.exact), row.deviation, row.unit)
        for row in tables.parameters(calibration)
    ]
    certain = (
        "Standard deviations are for corner errors as large as the residuals; they do not know of a bent"
        " target or a wrong lens formula."
        if calibration.uncertainty.names
        else "No standard deviations were estimated."
    )
    shape = shape_rows(calibration)
    misfits = [
        (row.what, row.systematic, row.noise, row.f, row.chance, row.p_value, row.p_over_views, row.moves)
        for row in tables.misfit_rows(evaluation)
    ]
    return tag(
        "section",
        tag(
            "div",
            tag("h2", "Camera"),
            table(("parameter", "value", "std. dev.", "unit"), parameters, class_="numbers"),
            tag("p", certain, class_="note"),
            class_="panel",
        ),
        tag(
            "div",
            tag("h2", f"Lens: {tables.lens_in_words(calibration.camera)}"),
            table((), tables.lens_rows(calibration), class_="facts-table"),
            (
                [
                    tag("h2", f"Target: {calibration.detections.target.name}"),
                    table((), shape, class_="facts-table"),
                ]
                if shape
                else None
            ),
            class_="panel",
        ),
        tag(
            "div",
            tag("h2", "What limits it"),
            tag("div", table(MISFIT_HEADINGS, misfits, class_="numbers"), class_="scroll"),
            tag(
                "p",
                "What is the same in every view, at a corner of the target or at a place of the image, is no"
                " noise: the target is not what it is said to be, or the formula cannot follow the lens."
                " Held-out errors cannot show it. Px are rms per point. p is the probability of such an F for"
                " independent noise; p over views, for any noise that differs from view to view.",
                class_="note",
            ),
            class_="panel wide",
        ),
        class_="plates",
    )


def set_aside(detections: Detections) -> Html | None:
    """Photographs that take no part, and why; nothing where all do."""
    if not detections.set_aside:
        return None
    rows = [(entry.image, entry.reason) for entry in detections.set_aside]
    return tag(
        "section",
        tag("h2", "Photographs set aside"),
        tag("div", table(("photograph", "reason"), rows, class_="set-aside"), class_="scroll"),
        class_="panel",
    )


def closing(evaluation: Evaluation) -> Html:
    """How it was made, and how to read it."""
    calibration = evaluation.calibration
    made = [
        ("orthoscope", calibration.version),
        ("method", calibration.method),
        *tables.settings_rows(calibration),
        ("solver", f"{calibration.status} ({_count(calibration.steps, 'step')})"),
        ("target", calibration.detections.target.name),
        (
            "normalised calibration error",
            f"{pixels(evaluation.nce)}; 1 is what rounding to whole pixels would give",
        ),
    ]
    notes = (
        (
            "A residual is predicted minus detected, in pixels. Rms is per point: the root of the mean of"
            " |e|², as OpenCV prints it; per coordinate, as mrcal prints it, it is smaller by √2."
        ),
        (
            "Held out: the method is run again without some photographs; on those the lens is fixed and only"
            " the board's pose is fitted."
        ),
        (
            "Pixel (0, 0) is the centre of the top-left pixel; x runs right, y down. Camera frame: x right, y"
            " down, z forward; lengths in metres."
        ),
        "A dash (–) is a number that does not exist or was not asked for.",
        (
            "In a figure: + and - or the buttons zoom, dragging moves, 0 resets; the arrow keys go from"
            " photograph to photograph; what is picked in one figure is picked in all."
        ),
    )
    return tag(
        "footer",
        tag(
            "div",
            tag("h2", "How it was made"),
            tag("dl", [[tag("dt", name), tag("dd", text)] for name, text in made]),
        ),
        tag("div", tag("h2", "How to read the page"), tag("ul", [tag("li", note) for note in notes])),
        class_="columns",
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
