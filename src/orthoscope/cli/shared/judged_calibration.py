"""A calibration with its evaluation: read where `calibrate` has written it, made anew where it has not.

What was judged in another number of folds, or belongs to another calibration, is no answer to the question and
is judged again.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orthoscope.evaluation.evaluate import Evaluation
    from orthoscope.fitting.calibration import Calibration

__all__ = ["EVALUATION_NAME", "judged_calibration"]

# An evaluation is written under this name, beside `calibration.json`.
EVALUATION_NAME = "evaluation.json"


def judged_calibration(path: Path, *, folds: int | None, jobs: int | None, cluster: str | None) -> Evaluation:
    """The evaluation of a calibration's file.

    Args:
        path: of calibration.json, of evaluation.json beside it, or of their folder.
        folds: asked for by the user, who then wants it done anew; else None.
        jobs, cluster: where folds are fitted, if they are.
    Raises:
        InputError: there is no calibration.
    """
    from orthoscope.formats.own.json import CALIBRATION_NAME, load_calibration

    if path.is_dir() or path.name == EVALUATION_NAME:
        path = (path if path.is_dir() else path.parent) / CALIBRATION_NAME
    calibration = load_calibration(path)
    found = None if folds else _written(calibration, path.with_name(EVALUATION_NAME))
    return found or _made(calibration, folds=folds, jobs=jobs, cluster=cluster)


def _written(calibration: Calibration, path: Path) -> Evaluation | None:
    """What stands beside the calibration, if it judges this one."""
    from orthoscope.formats.own.json import load_evaluation
    from orthoscope.geometry.arrays import InputError

    try:
        return load_evaluation(path, calibration) if path.exists() else None
    except InputError:
        return None


def _made(
    calibration: Calibration, *, folds: int | None, jobs: int | None, cluster: str | None
) -> Evaluation:
    from orthoscope.cli.shared.executors import processes
    from orthoscope.cli.shared.progress import bar
    from orthoscope.evaluation.evaluate import evaluate

    with processes(jobs if folds else jobs or 1, cluster) as executor, bar("evaluating") as progress:
        return evaluate(calibration, folds=folds, executor=executor, progress=progress)
