"""What only `decoupled` does: the target's true shape, and a lens that no formula limits; time against those
who offer the like.
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.corner_files import write_corners
from benchmarks.parts.solving import scene_file, solver
from benchmarks.peers import Peers
from benchmarks.race import race
from benchmarks.real_sets import classic_corners, datasets
from benchmarks.rows import Part, Row
from orthoscope.methods.fccm import fccm

__all__ = ["shape_and_lens"]

ROUNDS = {15: 5, 50: 3, 200: 2}
LONGEST = {"free target": 0.3e3, "free target and lens": 1.0e3, "chosen by itself": 5.0e3}  # ms at 15 views
ABOUT = (
    "Process CPU time of one call, one thread, the best of several rounds. Released target: every corner of"
    " the board its own place, on the 20 views of calibrel (160 corners each) against calibrateCameraRO with"
    " LU, and on simulated views of 14x20 corners. Free lens: a spline over a formula, against mrcal's"
    " splined stereographic lens of 16x12 knots (board flat, no outlier rejection) and lensboy's. Each is"
    " told its one model, ours the formula under it, brown."
)


def shape_and_lens(peers: Peers, folder: Path) -> Part:
    """Released target and free lens."""
    part = Part("Target shape and free lens", ABOUT)
    files = {count: scene_file(folder, count) for count in ROUNDS}
    if data := datasets():
        near = fccm(classic_corners(data, "calibrel"), lens="brown")
        calibrel = write_corners(
            folder / "calibrel.npz", near.detections, near.camera, near.camera_from_target
        )
        _row(part, peers, ("calibrel", calibrel, 3), ("free target", "OpenCV", "released 5", 0.10))
    else:
        part.remarks.append("The photographs are not there; ORTHOSCOPE_DATASETS names their folder.")
    _row(part, peers, ("15 views", files[15], 2), ("free target", "OpenCV", "released 5", 0.10))
    for count, rounds in ROUNDS.items():
        _row(
            part,
            peers,
            (f"{count} views", files[count], rounds),
            ("free lens", "mrcal", "splined plain", 1.0),
        )
    _row(part, peers, ("15 views", files[15], 1), ("free lens", "lensboy", "spline plain", None))
    _row(part, peers, ("15 views", files[15], 2), ("free target and lens", "mrcal", "splined", None))
    _own_times(part, peers, files)
    return part


def _row(
    part: Part, peers: Peers, what: tuple[str, str, int], who: tuple[str, str, str, float | None]
) -> None:
    """One race of ours against a peer; its row, or why there is none."""
    (data, path, rounds), (ours_kind, peer, kind, budget) = what, who
    contenders = {
        "ours": solver(peers, "orthoscope", path, ours_kind),
        "theirs": solver(peers, peer, path, kind),
    }
    results = race(contenders, rounds=rounds)
    ours, theirs = results["ours"], results["theirs"]
    for name, result in ((f"orthoscope {ours_kind}", ours), (f"{peer} {kind}", theirs)):
        if result.failed:
            part.remarks.append(f"{data}, {name}: {result.failed}.")
    if not theirs.failed:
        mine = None if ours.failed else ours.cpu
        note = (
            f"rms {'' if ours.failed else format(ours.answer['rms'], '.5f')} and {theirs.answer['rms']:.5f}"
        )
        part.rows.append(Row(f"{ours_kind}, {data}", mine, f"{peer} {kind}", theirs.cpu, "ms", budget, note))


def _own_times(part: Part, peers: Peers, files: dict[int, str]) -> None:
    """Times that a user waits, everything included."""
    for kind, longest in LONGEST.items():
        result = race({"ours": solver(peers, "orthoscope", files[15], kind)}, rounds=3)["ours"]
        if result.failed:
            part.remarks.append(f"15 views, {kind}: {result.failed}.")
        else:
            part.rows.append(
                Row(
                    f"{kind}, 15 views: time by itself",
                    result.cpu,
                    "",
                    None,
                    "ms",
                    longest,
                    f"wall {result.wall:.0f} ms",
                )
            )
