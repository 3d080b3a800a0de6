"""Error on photographs that were not used, on real sets: the protocol of `held_out`, for every
peer.
"""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.corner_files import write_corners
from benchmarks.peers import Peers
from benchmarks.real_sets import SETS, babel_cube, classic_corners, datasets, zhang
from benchmarks.rows import Part, Row
from orthoscope.fitting.unseen.held_out import folds_of_views
from orthoscope.methods.fccm import fccm
from orthoscope.targets.detections import Detections

__all__ = ["held_out"]

PEERS = [
    *(
        ("OpenCV", f"{board} {coefficients}")
        for board in ("flat", "released")
        for coefficients in (5, 8, 12, 14)
    ),
    *(("lensboy", kind) for kind in ("5", "14", "spline")),
    *(("mrcal", kind) for kind in ("OPENCV8", "splined")),
]
WIDE_PEERS = [
    ("OpenCV", "fisheye"),
    ("OpenCV", "flat 8"),
    ("lensboy", "14"),
    ("lensboy", "spline"),
    ("mrcal", "splined"),
]
CHOSEN = "chosen by itself"
PATIENCE = 12.0  # seconds: a peer that has taken so long over the sets so far is not asked about the others
OURS, WIDE_OURS = (CHOSEN, "free target", "brown"), (CHOSEN, "kannala_brandt")
JUDGED = ("opencv-left", "udacity", "sony", "bumblebee-left", "bumblebee-right", "calibrel")
ABOUT = (
    "Real photographs, corners as OpenCV's classic finder and cornerSubPix found them. Five folds of views"
    " (numpy's default_rng(0)); lens and target shape come from the other views, only the pose of a held-out"
    " view is fitted, by one piece of code for all. Root mean square over all held-out corners, px per point;"
    " the median behind it. Each of our rows stands against the best peer of that set; the table below has"
    " them all. lensboy and mrcal estimate their board warp and reject outliers, as they do by default."
    " babel-cube: fitted to its training views, judged on its published test views."
)


class _Error(NamedTuple):
    """Root mean square and median over held-out corners, px per point; failed: why there is none."""

    rms: float
    median: float
    failed: str = ""


def held_out(peers: Peers, folder: Path) -> Part:
    """Every set, every peer."""
    part = Part("Held-out accuracy", ABOUT)
    data = datasets()
    if data is None:
        part.remarks.append("The photographs are not there; ORTHOSCOPE_DATASETS names their folder.")
        return part
    spent: dict[tuple[str, str], float] = {}
    errors = {
        name: _errors(part, peers, folder, name, detections, folds, spent)
        for name, (detections, folds) in _tasks(data).items()
    }
    for name, found in errors.items():
        _rows(part, name, found)
    _mean_row(part, errors)
    part.appendix += _table(errors)
    return part


def _tasks(data: Path) -> dict[str, tuple[Detections, list[list[int]]]]:
    """Detections and folds of each set."""
    sets = {name: classic_corners(data, name) for name in SETS} | {"zhang": zhang(data)}
    tasks = {
        name: (found, [fold.tolist() for fold in folds_of_views(len(found.views), 5)])
        for name, found in sets.items()
    }
    cube, training = babel_cube(data)
    return tasks | {"babel-cube": (cube, [list(range(training, len(cube.views)))])}


def _errors(
    part: Part,
    peers: Peers,
    folder: Path,
    name: str,
    detections: Detections,
    folds: list[list[int]],
    spent: dict[tuple[str, str], float],
) -> dict[tuple[str, str], _Error]:
    """The error of every peer on one set; why one failed goes to the remarks.

    Args:
        spent: seconds that each has taken so far.
    """
    wide = name in ("fisheye-180", "babel-cube")
    near = fccm(detections, lens="kannala_brandt" if wide else "brown")
    path = write_corners(folder / f"{name}.npz", near.detections, near.camera, near.camera_from_target)
    errors = {}
    for peer, kind in [
        *(("orthoscope", kind) for kind in (WIDE_OURS if wide else OURS)),
        *(WIDE_PEERS if wide else PEERS),
    ]:
        if peer != "orthoscope" and spent.get((peer, kind), 0.0) > PATIENCE:
            part.remarks.append(f"{name}, {peer} {kind}: not asked, since it took {PATIENCE:.0f} s before.")
            continue
        start = time.perf_counter()
        error = _error(peers.ask(peer, "held_out", path=path, kind=kind, folds=folds))
        spent[peer, kind] = spent.get((peer, kind), 0.0) + time.perf_counter() - start
        errors[peer, kind] = error
        if error.failed and peer not in peers.missing:
            part.remarks.append(f"{name}, {peer} {kind}: {error.failed}.")
    return errors


def _error(answer: dict[str, Any]) -> _Error:
    if failed := answer.get("failed") or next(iter(answer["failed_folds"]), ""):
        return _Error(math.nan, math.nan, failed)
    lengths = np.concatenate(answer["lengths"])
    if np.isnan(lengths).any():
        return _Error(
            math.nan, math.nan, f"no image for {np.isnan(lengths).sum()} of {len(lengths)} held-out corners"
        )
    return _Error(float(np.sqrt(np.mean(lengths**2))), float(np.median(lengths)))


def _best(errors: dict[tuple[str, str], _Error]) -> tuple[str, _Error] | None:
    """The best peer and its error."""
    others = {
        f"{peer} {kind}": error
        for (peer, kind), error in errors.items()
        if peer != "orthoscope" and not error.failed
    }
    return min(others.items(), key=lambda entry: entry[1].rms, default=None)


def _rows(part: Part, name: str, errors: dict[tuple[str, str], _Error]) -> None:
    best = _best(errors)
    for (peer, kind), error in errors.items():
        if peer == "orthoscope" and best and not error.failed:
            budget = 1.0 if kind == CHOSEN and name in JUDGED else None
            note = f"median {error.median:.4f} and {best[1].median:.4f}"
            part.rows.append(Row(f"{name}: {kind}", error.rms, best[0], best[1].rms, "px", budget, note))


def _mean_row(part: Part, errors: dict[str, dict[tuple[str, str], _Error]]) -> None:
    """Geometric means over the sets of the budget."""
    pairs = [(errors[name]["orthoscope", CHOSEN], _best(errors[name])) for name in JUDGED]
    if all(best and not ours.failed for ours, best in pairs):
        ours, theirs = (
            math.exp(float(np.mean(np.log(values))))
            for values in zip(*((o.rms, b[1].rms) for o, b in pairs if b), strict=True)
        )
        part.rows.append(
            Row(
                f"geometric mean over {len(pairs)} sets: {CHOSEN}",
                ours,
                "best peer of each",
                theirs,
                "px",
                0.97,
            )
        )


def _table(errors: dict[str, dict[tuple[str, str], _Error]]) -> list[str]:
    """Everybody on every set, as Markdown."""
    who = dict.fromkeys(key for found in errors.values() for key in found)
    lines = ["| | " + " | ".join(errors) + " |", "|---|" + "---:|" * len(errors)]
    for peer, kind in who:
        cells = [_cell(found.get((peer, kind))) for found in errors.values()]
        lines.append(f"| {peer} {kind} | " + " | ".join(cells) + " |")
    return lines


def _cell(error: _Error | None) -> str:
    if error is None:
        return ""
    return "fails" if error.failed else f"{error.rms:.4f} / {error.median:.4f}"
