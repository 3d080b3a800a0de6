"""Finding corners in rendered photographs: how fast, how near the truth, how often."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers import Peers
from benchmarks.race import race
from benchmarks.rendered import Condition, Photographs, rendered
from benchmarks.rows import Part, Row
from orthoscope.models.lenses.table import Brown, KannalaBrandt

__all__ = ["accuracy", "detecting"]

SIZES = {"640x480": (640, 480), "1920x1080": (1920, 1080), "4000x3000": (4000, 3000)}
SLOW = (
    1920 * 1080
)  # pixels from which the sector-based finder takes 1 to 10 s a photograph: it is timed, not swept
TILTS = ((0.0, 15.0), (30.0, 40.0), (55.0, 65.0))
SWEEPS = [
    *(Condition(f"blur {blur} px", blur=blur) for blur in (0.4, 1.0, 1.5, 2.5)),
    *(Condition(f"noise {noise:g} grey levels", noise=noise) for noise in (0.0, 5.0, 10.0, 20.0)),
    Condition("no distortion", lens=Brown()),
    Condition("strong distortion", lens=Brown(k1=-0.35, k2=0.12)),
    Condition("fisheye", lens=KannalaBrandt(k1=-0.02, k2=0.003)),
]
CLASSIC = ("classic 5", "classic 11")
BUDGETS = {"4000x3000": {"classic 5": 0.15, "sb": 0.02}}
LIGHTS = (("sharp", 0.7, 2.0), ("usual", 1.2, 5.0), ("poor", 2.5, 10.0))  # blur px, noise grey levels
SPEED = (
    "Rendered photographs of 14x20 corners, sharp, usual and poor ones (blur 0.7, 1.2, 2.5 px; noise 2, 5, 10"
    " grey levels), refinement included, reading the file not; process CPU time a photograph in the mean, one"
    " thread, the best of several rounds. OpenCV: findChessboardCorners and cornerSubPix (window 5),"
    " findChessboardCornersSB with ACCURACY. Its classic finder takes its time where the first threshold"
    " fails, so the ratio of medians stands in the remarks. mrgingham finds square boards (here 10x10) only;"
    " its time is that of its command, which reads the file too."
)
ERRORS = (
    "Root mean square distance from the truth over all corners, px per point, on photographs in which all"
    " found the board. OpenCV's figure is the better of cornerSubPix with windows 5 and 11; that of"
    " findChessboardCornersSB with ACCURACY stands in the remarks. 14x9 corners; where not said: 1280x960,"
    " tilt 0 to 35 degrees, blur 0.7 px, noise 2 grey levels, k1 = -0.2."
)


def detecting(peers: Peers, folder: Path) -> Part:
    """Time for each size of photograph."""
    part = Part("Finding corners: speed", SPEED)
    for name, size in SIZES.items():
        large = size[0] * size[1] > SLOW
        lights = [
            Condition(f"{light} {name}", size, blur=blur, noise=noise, grid=(14, 20), count=2)
            for light, blur, noise in LIGHTS
        ]
        photographs = _together([rendered(condition, folder) for condition in lights])
        few = replace(photographs, paths=photographs.paths[:: 2 if large else 1])
        budgets = BUDGETS.get(name, {})
        _race(
            part,
            peers,
            photographs,
            name,
            ("OpenCV", "classic 5", 2 if large else 4, budgets.get("classic 5")),
        )
        _race(part, peers, few, name, ("OpenCV", "sb", 1, budgets.get("sb")))
        square = rendered(Condition(f"square {name}", size, count=2, grid=(10, 10)), folder)
        _race(part, peers, square, name, ("mrgingham", "mrgingham", 2, None))
    return part


def accuracy(peers: Peers, folder: Path) -> Part:
    """Error and share of boards found, over sizes, tilts, blur, noise and distortion."""
    part = Part("Finding corners: accuracy", ERRORS)
    usual = [
        Condition(f"{name}, tilt {tilt[0]:g} to {tilt[1]:g}°", size=size, tilt=tilt)
        for name, size in SIZES.items()
        for tilt in TILTS
    ]
    missed = np.zeros(2, dtype=int)
    for condition in usual:
        missed += _compare(part, peers, rendered(condition, folder), condition, 0.5)
    for condition in SWEEPS:
        missed += _compare(part, peers, rendered(condition, folder), condition, None)
    note = f"{missed[0]} and {missed[1]} missed"
    part.rows.append(
        Row(
            "boards missed more than the better OpenCV finder",
            float(missed[0] - missed[1]),
            "",
            None,
            "",
            0.0,
            note,
        )
    )
    _against_mrgingham(part, peers, folder)
    return part


def _together(photographs: list[Photographs]) -> Photographs:
    """All of one board in one list."""
    paths = [path for each in photographs for path in each.paths]
    corners = [truth for each in photographs for truth in each.corners]
    return Photographs(paths, corners, photographs[0].grid)


def _finder(peers: Peers, peer: str, photographs: Photographs, kind: str) -> Callable[[], dict[str, Any]]:
    return lambda: peers.ask(peer, "find", paths=photographs.paths, grid=photographs.grid, kind=kind)


def _race(
    part: Part, peers: Peers, photographs: Photographs, name: str, what: tuple[str, str, int, float | None]
) -> None:
    """One race of ours against a peer; its row, or why there is none."""
    peer, kind, rounds, budget = what
    contenders = {
        "ours": _finder(peers, "orthoscope", photographs, "orthoscope"),
        "theirs": _finder(peers, peer, photographs, kind),
    }
    results = race(contenders, rounds=rounds)
    ours, theirs = results["ours"], results["theirs"]
    if ours.failed or theirs.failed:
        part.remarks.append(f"{name}, against {peer} {kind}: {ours.failed or theirs.failed}.")
        return
    count = len(photographs.paths)
    found = [sum(bool(corners) for corners in result.answer["corners"]) for result in (ours, theirs)]
    rates = [1e3 * count / result.cpu for result in (ours, theirs)]
    note = (
        f"{rates[0]:.3g} and {rates[1]:.3g} photographs a second; found {found[0]} and {found[1]} of {count}"
    )
    if "each" in theirs.answer:
        medians = [1e3 * float(np.median(result.answer["each"])) for result in (ours, theirs)]
        note = f"medians {medians[0]:.3g} and {medians[1]:.3g} ms; {note}"
    peer_name = peer if peer == kind else f"{peer} {kind}"
    part.rows.append(Row(name, ours.cpu / count, peer_name, theirs.cpu / count, "ms", budget, note))


def _compare(
    part: Part, peers: Peers, photographs: Photographs, condition: Condition, budget: float | None
) -> np.ndarray:
    """A row of errors; boards missed by us and by the better of OpenCV's finders."""
    kinds = (*CLASSIC, "sb") if condition.size[0] * condition.size[1] < SLOW else CLASSIC
    answers = {kind: _finder(peers, "OpenCV", photographs, kind)() for kind in kinds}
    answers = {"ours": _finder(peers, "orthoscope", photographs, "orthoscope")(), **answers}
    if failed := [f"{kind}: {answer['failed']}" for kind, answer in answers.items() if "failed" in answer]:
        part.remarks.append(f"{condition.name}: {'; '.join(failed)}.")
        return np.zeros(2, dtype=int)
    errors = {kind: photographs.errors(answer["corners"]) for kind, answer in answers.items()}
    found = {kind: sum(error is not None for error in each) for kind, each in errors.items()}
    rms = {kind: _rms_on_common(errors["ours"], each) for kind, each in errors.items()}
    best = min(CLASSIC, key=lambda kind: rms[kind][1])
    sb = f"; sb {rms['sb'][1]:.3f} px, found {found['sb']}" if "sb" in rms else ""
    note = f"found {found['ours']} and {found[best]} of {len(photographs.paths)}{sb}"
    if np.isfinite(rms[best]).all():
        part.rows.append(
            Row(condition.name, rms[best][0], f"OpenCV {best}", rms[best][1], "px", budget, note)
        )
    else:
        part.remarks.append(f"{condition.name}: no board was found by both; {note}.")
    total = len(photographs.paths)
    return np.array([total - found["ours"], total - max(found[kind] for kind in kinds)])


def _rms_on_common(ours: list[Any], theirs: list[Any]) -> tuple[float, float]:
    """Root mean squares of both on the photographs in which both found the board; NaN where there is none."""
    pairs = [(a, b) for a, b in zip(ours, theirs, strict=True) if a is not None and b is not None]
    if not pairs:
        return float("nan"), float("nan")
    mine, others = (np.concatenate(each) for each in zip(*pairs, strict=True))
    return float(np.sqrt((mine**2).mean())), float(np.sqrt((others**2).mean()))


def _against_mrgingham(part: Part, peers: Peers, folder: Path) -> None:
    for name, size in SIZES.items():
        condition = replace(Condition(f"{name}, 10x10 corners", size=size), grid=(10, 10), count=3)
        photographs = rendered(condition, folder)
        answers = [_finder(peers, peer, photographs, peer)() for peer in ("orthoscope", "mrgingham")]
        if failed := next((answer["failed"] for answer in answers if "failed" in answer), None):
            part.remarks.append(f"{condition.name}, against mrgingham: {failed}.")
            continue
        ours, theirs = (photographs.errors(answer["corners"]) for answer in answers)
        rms = _rms_on_common(ours, theirs)
        found = [sum(error is not None for error in each) for each in (ours, theirs)]
        note = f"found {found[0]} and {found[1]} of {len(photographs.paths)}"
        if np.isfinite(rms).all():
            part.rows.append(Row(condition.name, rms[0], "mrgingham", rms[1], "px", None, note))
        else:
            part.remarks.append(f"{condition.name}: no board was found by both; {note}.")
