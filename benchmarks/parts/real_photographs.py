"""Corners in real photographs: whose corners make the same calibration fit better, and who finds
more boards.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.corner_files import write_corners
from benchmarks.peers import Peers
from benchmarks.real_sets import SETS, RealSet, datasets
from benchmarks.rows import Part, Row
from orthoscope.files.images import photographs, read_image
from orthoscope.geometry.arrays import CalibrationError, ndarray
from orthoscope.methods.fccm import fccm
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

__all__ = ["real_photographs"]

FINDERS = {"classic 5": "OpenCV", "classic 11": "OpenCV", "sb": "OpenCV", "orthoscope": "orthoscope"}
ABOUT = (
    "Root mean square residual of the same calibration, px per point, over the photographs in which all found"
    " the board: a flat board with the lens that suits the camera, and where it is there a board whose"
    " corners are free, so that the board's own faults do not hide the corners'. OpenCV's figure is the best"
    " of findChessboardCorners with cornerSubPix (windows 5 and 11) and findChessboardCornersSB with"
    " ACCURACY."
)

Found = dict[str, dict[str, ndarray]]  # by finder, by photograph


def real_photographs(peers: Peers, folder: Path) -> Part:
    """Every set that has photographs of a whole chessboard."""
    part = Part("Corners of real photographs", ABOUT)
    data = datasets()
    if data is None:
        part.remarks.append("The photographs are not there; ORTHOSCOPE_DATASETS names their folder.")
        return part
    logs: dict[str, list[float]] = {}
    for name, real in SETS.items():
        paths = _photographs(data, real)
        found = {
            kind: _found(part, peers.ask(peer, "find", paths=paths, grid=real.grid, kind=kind), paths, kind)
            for kind, peer in FINDERS.items()
        }
        most = max(len(found[kind]) for kind in FINDERS if kind != "orthoscope")
        missed = float(most - len(found["orthoscope"]))
        note = f"{len(found['orthoscope'])} and {most} of {len(paths)} found"
        part.rows.append(
            Row(f"{name}: boards found fewer than the best finder", missed, unit="", at_most=0.0, note=note)
        )
        for kind in (real.lens, "free target") if real.lens == "brown" else (real.lens,):
            _compare(part, peers, folder, (name, kind), found, logs)
    for kind, values in logs.items():
        part.rows.append(
            Row(
                f"geometric mean of {len(values)} ratios: {kind}",
                math.exp(float(np.mean(values))),
                unit="",
                at_most=0.95,
            )
        )
    return part


def _photographs(data: Path, real: RealSet) -> list[str]:
    """The files of a set that have the size of most."""
    files = [
        file for file in photographs([data / real.photographs.split("/")[0]]) if file.match(real.photographs)
    ]
    sizes = [read_image(file, grey=True).shape for file in files]
    usual = max(set(sizes), key=sizes.count)
    return [str(file) for file, size in zip(files, sizes, strict=True) if size == usual]


def _found(part: Part, answer: dict[str, Any], paths: list[str], kind: str) -> dict[str, ndarray]:
    if "failed" in answer:
        part.remarks.append(f"{kind}: {answer['failed']}.")
        return {}
    return {
        path: np.array(corners) for path, corners in zip(paths, answer["corners"], strict=True) if corners
    }


def _compare(
    part: Part, peers: Peers, folder: Path, what: tuple[str, str], found: Found, logs: dict[str, list[float]]
) -> None:
    """The row of one calibration on one set."""
    (name, kind), ours = what, found["orthoscope"]
    common = [
        path for path in ours if all(_same_board(ours[path], each.get(path)) for each in found.values())
    ]
    if not common:
        part.remarks.append(f"{name}: no board was found by all.")
        return
    rms: dict[str, float] = {}
    for finder, each in found.items():
        ordered = {path: each[path][_order(ours[path], each[path])] for path in common}
        answer = _fit(peers, folder / f"{name}-{finder.replace(' ', '-')}.npz", SETS[name], ordered, kind)
        if "failed" in answer:
            part.remarks.append(f"{name}, {kind}, corners of {finder}: {answer['failed']}.")
            return
        rms[finder] = answer["rms"]
    best = min((finder for finder in rms if finder != "orthoscope"), key=lambda finder: rms[finder])
    told = ", ".join(
        f"{finder} {value:.4f}" for finder, value in rms.items() if finder not in ("orthoscope", best)
    )
    row = Row(
        f"{name}: {kind}, {len(common)} photographs",
        rms["orthoscope"],
        f"OpenCV {best}",
        rms[best],
        "px",
        0.95,
        told,
    )
    logs.setdefault(kind, []).append(math.log(rms["orthoscope"] / rms[best]))
    part.rows.append(row)


def _fit(peers: Peers, path: Path, real: RealSet, corners: dict[str, ndarray], kind: str) -> dict[str, Any]:
    """The calibration of these corners by the worker."""
    first = read_image(next(iter(corners)), grey=True)
    target = chessboard(*real.grid, 1.0)
    views = tuple(View(Path(file).name, np.arange(len(pixels)), pixels) for file, pixels in corners.items())
    detections = Detections(target, (first.shape[1], first.shape[0]), views)
    try:
        near = fccm(detections, lens=real.lens)
    except CalibrationError as error:
        return {"failed": str(error)}
    return peers.ask(
        "orthoscope",
        "solve",
        path=write_corners(path, detections, near.camera, near.camera_from_target),
        kind=kind,
    )


def _order(ours: ndarray, theirs: ndarray) -> ndarray:
    """The row of theirs that is nearest to each of ours; finders may start at another end of the board."""
    return np.hypot(*(ours[:, None] - theirs[None]).transpose(2, 0, 1)).argmin(1)


def _same_board(ours: ndarray, theirs: ndarray | None) -> bool:
    return (
        theirs is not None
        and theirs.shape == ours.shape
        and len(np.unique(_order(ours, theirs))) == len(ours)
    )
