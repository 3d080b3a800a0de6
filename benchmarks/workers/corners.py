"""Corners as they travel to a worker, the fit that comes back, and the folds that judge it.

Plain numpy, because it runs inside every peer's environment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from pose_refit import refit_pose
from served import peak, reason, timed

__all__ = ["Corners", "Fit", "tasks_of"]


class Corners(NamedTuple):
    """Detections in plain arrays; focal and fov_x are what a user would tell a peer that asks for a first
    guess.

    points: (m,3) of the target. grid: (columns, rows) where they make one, else None. ids, pixels: one entry
    for each view. starts: rotation (3,3) and translation (3,) of each view, camera from target, from which
    held-out poses are refitted.
    """

    points: np.ndarray
    image_size: tuple[int, int]
    grid: tuple[int, int] | None
    focal: float
    fov_x: float
    ids: list[np.ndarray]
    pixels: list[np.ndarray]
    starts: list[tuple[np.ndarray, np.ndarray]]

    @classmethod
    def load(cls, path: str) -> Corners:
        """From the file that benchmarks/corner_files.py wrote."""
        with np.load(path) as table:
            cuts = np.cumsum(table["counts"])[:-1]
            return cls(
                points=table["points"],
                image_size=tuple(table["image_size"].tolist()),
                grid=tuple(table["grid"].tolist()) or None,
                focal=float(table["focal"]),
                fov_x=float(table["fov_x"]),
                ids=np.split(table["ids"], cuts),
                pixels=np.split(table["pixels"], cuts),
                starts=list(zip(table["rotations"], table["translations"], strict=True)),
            )

    def only(self, views: list[int]) -> Corners:
        """The same with these views only."""
        ids, pixels, starts = ([parts[i] for i in views] for parts in (self.ids, self.pixels, self.starts))
        return self._replace(ids=ids, pixels=pixels, starts=starts)


class Fit(NamedTuple):
    """A camera: `project` takes points (n,3) of the camera frame to pixels; points: (m,3), the target as this
    peer believes it to be.

    rms: over the corners that it was fitted to, px per point.
    """

    project: Callable[[np.ndarray], np.ndarray]
    points: np.ndarray
    rms: float


def tasks_of(
    kinds: Mapping[str, Callable[[Corners], Fit]], version: Callable[[], str]
) -> dict[str, Callable[..., dict[str, Any]]]:
    """What every worker that calibrates can be asked; kinds: its calibrations by name."""
    loaded: dict[str, Corners] = {}

    def corners_in(path: str) -> Corners:
        return loaded.setdefault(path, loaded.get(path) or Corners.load(path))

    def solve(path: str, kind: str) -> dict[str, Any]:
        corners = corners_in(path)
        fit, times = timed(lambda: kinds[kind](corners))
        return {**times, "rms": float(fit.rms)}

    def held_out(path: str, kind: str, folds: list[list[int]]) -> dict[str, Any]:
        return _held_out(corners_in(path), kinds[kind], folds)

    return {"solve": solve, "held_out": held_out, "peak": peak, "version": lambda: {"version": version()}}


def _held_out(corners: Corners, fit: Callable[[Corners], Fit], folds: list[list[int]]) -> dict[str, Any]:
    """Lengths (px) of the residuals in each view of the folds, from fits that did not see it; NaN where the
    fit failed, and why.
    """
    lengths: dict[int, list[float]] = {}
    failed: list[str] = []
    for fold in folds:
        try:
            fitted = fit(corners.only([i for i in range(len(corners.ids)) if i not in set(fold)]))
        except Exception as error:  # a peer may raise anything; the other folds shall still be measured
            failed.append(reason(error))
            lengths |= {i: [float("nan")] * len(corners.ids[i]) for i in fold}
            continue
        for i in fold:
            error = refit_pose(
                fitted.project, fitted.points[corners.ids[i]], corners.pixels[i], corners.starts[i]
            )
            lengths[i] = np.hypot(*error.T).tolist()
    return {"lengths": [lengths[i] for fold in folds for i in fold], "failed_folds": failed}
