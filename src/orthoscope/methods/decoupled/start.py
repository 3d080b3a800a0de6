"""Where a fit of step 1 starts: from a flat calibration, and from another fit as far as it goes.

The board is the same whatever the lens: its shape, and how large its displacements are, carry over from any
fit. Camera, displacement of the lens and poses carry over between fits on the same base. How large the noise
is does not, but where the models are of one kind: the loss would shut out what a poorer model cannot explain.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from orthoscope.methods.decoupled.evidence import Evidence
from orthoscope.methods.decoupled.problem import DecoupledEstimate
from orthoscope.models.camera import Camera
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.lens import Lens

__all__ = ["Start", "nearer"]


class Start(NamedTuple):
    """An estimate and the weights that go with it."""

    estimate: DecoupledEstimate
    evidence: Evidence


def nearer(start: Start, other: Start, *, free_corners: bool) -> Start:
    """A start brought nearer by another fit of the same target.

    Args:
        start: of the fit to come.
        other: where the other ended.
        free_corners: whether the fit to come has displacements of single corners.
    """
    (camera, poses, surface, singles), evidence = start
    if shaped := bool(surface.size) and other.estimate.surface.shape == surface.shape:
        surface = other.estimate.surface
        evidence = evidence.with_shape_of(other.evidence)
    if shaped and free_corners:
        singles = other.estimate.singles
    theirs = other.estimate.camera
    if type(_base(theirs)) is type(_base(camera)):
        if isinstance(theirs.lens, FreeLens):
            evidence = replace(evidence, bend=other.evidence.bend)
        if len(other.estimate.poses.rotation) == len(poses.rotation):
            poses = other.estimate.poses
        same = isinstance(theirs.lens, FreeLens) == isinstance(camera.lens, FreeLens)
        camera = theirs if same else _with_lens_like(theirs, camera)
        if (
            same
            and shaped == bool(other.estimate.surface.size)
            and free_corners == other.estimate.singles.any()
        ):
            evidence = replace(evidence, noise=other.evidence.noise, likeness=other.evidence.likeness)
    return Start(DecoupledEstimate(camera, poses, surface, singles), evidence)


def _base(camera: Camera) -> Lens:
    """The formula under a camera's lens."""
    return camera.lens.base if isinstance(camera.lens, FreeLens) else camera.lens


def _with_lens_like(theirs: Camera, camera: Camera) -> Camera:
    """Their camera, with a displacement where the other has one and none where not."""
    if isinstance(camera.lens, FreeLens):
        return replace(theirs, lens=FreeLens(_base(theirs), camera.lens.over))
    return replace(theirs, lens=_base(theirs))
