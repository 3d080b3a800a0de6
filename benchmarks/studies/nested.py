"""What the whole choice loses on photographs that it never saw, against the best entry of its own table.

    ORTHOSCOPE_DATASETS=photographs python -m benchmarks.studies.nested [detections.json ...]

Five folds of views: everything is chosen again without a fold, and the fold is foretold. The same folds are
foretold by each entry alone: every base by its richest model, and the simplest on the base that is taken from
all photographs. The best of these is only known afterwards.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from benchmarks.real_sets import SETS, classic_corners, datasets
from orthoscope import CalibrationError, Detections, load_detections
from orthoscope.fitting.unseen.held_out import held_out
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.methods.decoupled.model import BASES


def entries(base: str) -> dict[str, dict[str, str]]:
    """Settings of each entry of the table, where this base is taken."""
    ends = {f"{base}, flat, formula": {"base": base, "shape": "flat", "first_lens": "formula"}}
    return {
        f"{base}, free, free": {"base": base, "shape": "free", "first_lens": "free"} for base in BASES
    } | ends


def foretold(detections: Detections, **settings: str) -> float:
    """Held-out rms, px; infinite where a fold cannot be calibrated so."""
    try:
        found = held_out(detections, partial(decoupled, **settings)).rms_px
    except CalibrationError:
        return math.inf
    return found if math.isfinite(found) else math.inf


def sets(files: Sequence[Path]) -> Iterator[tuple[str, Detections]]:
    """Real sets, then detections."""
    yield from ((name, classic_corners(datasets(), name)) for name in SETS)
    yield from ((file.stem, load_detections(file)) for file in files)


def main(files: Sequence[Path]) -> None:
    """Print a line for each set, and the mean."""
    logs = []
    for name, detections in sets(files):
        chosen = foretold(detections)
        table = {
            entry: foretold(detections, **settings)
            for entry, settings in entries(decoupled(detections).settings["base"]).items()
        }
        best = min(table, key=table.__getitem__)
        logs.append(math.log(chosen / table[best]))
        print(
            f"{name:16s} {chosen:.4f} px, the best {table[best]:.4f} ({best}): {chosen / table[best]:.3f}",
            flush=True,
        )
    print(f"geometric mean of {len(logs)}: {math.exp(sum(logs) / len(logs)):.3f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", type=Path)
    main(parser.parse_args().files)
