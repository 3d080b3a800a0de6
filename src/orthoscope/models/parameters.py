"""Parameters of a camera that may move: their names, their ties, their values, the camera after a step.

A camera has K's `fx`, `fy`, `cx`, `cy`, `skew`; its lens's coefficients by their own names; and, where the
lens has a frame of its own, the frame's `centre_x`, `centre_y`, `frame_fx`, `frame_fy`, with `frame_scale`
for the two last together. Names joined by `=` are tied: they take the same steps, so `fx=fy` keeps pixels
square and `fx=frame_scale` lets the unit of the lens's radius follow the focal length. In a rig a camera's
name comes first, `left:fx=fy`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from orthoscope.geometry.arrays import Float, InputError, ndarray
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.spline import Displacement

if TYPE_CHECKING:
    from orthoscope.models.camera import Camera
    from orthoscope.models.intrinsics import Intrinsics

__all__ = ["FRAME", "INTRINSICS", "Parameters"]

INTRINSICS = ("fx", "fy", "cx", "cy", "skew")
# A lens frame's parameters, and the entries of its matrix that each moves, by the names of Intrinsics.
FRAME: dict[str, tuple[str, ...]] = {
    "centre_x": ("cx",),
    "centre_y": ("cy",),
    "frame_fx": ("fx",),
    "frame_fy": ("fy",),
    "frame_scale": ("fx", "fy"),
}
FOCAL_LENGTHS = ("fx", "fy")


@dataclass(frozen=True)
class Parameters:
    """The free parameters of one camera, in order; each is a group of names that are tied together.

    Attributes:
        groups: the names of each.
        camera: whose they are, in a rig; empty where there is one camera only.
    """

    groups: tuple[tuple[str, ...], ...]
    camera: str = ""

    @classmethod
    def of(cls, free: Parameters | Iterable[str]) -> Parameters:
        """The parameters that are written so, `("fx=fy", "cx", "k1")`.

        Args:
            free: as `names` gives them.
        Raises:
            InputError: they are of more than one camera of a rig.
        """
        return free if isinstance(free, Parameters) else _parsed(tuple(free))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Each as it is written."""
        prefix = f"{self.camera}:" if self.camera else ""
        return tuple(prefix + "=".join(group) for group in self.groups)

    @cached_property
    def singles(self) -> tuple[str, ...]:
        """Every name, those of a tie one by one."""
        return tuple(name for group in self.groups for name in group)

    @cached_property
    def coefficients(self) -> tuple[str, ...]:
        """The names that are the lens's, each once."""
        return tuple(
            dict.fromkeys(name for name in self.singles if name not in INTRINSICS and name not in FRAME)
        )

    def __len__(self) -> int:
        return len(self.groups)

    def only(self, names: Collection[str]) -> Parameters:
        """Those of which every name is among these."""
        return replace(self, groups=tuple(group for group in self.groups if set(group) <= set(names)))

    def check(self, camera: Camera) -> None:
        """See that a camera has them, each once.

        Raises:
            InputError: it has not, or one is named twice.
        """
        known = (*INTRINSICS, *camera.lens.names(), *(FRAME if camera.lens_frame else ()))
        for name in self.singles:
            if name not in known:
                raise InputError(
                    f"parameter {name!r} of this camera cannot be estimated; expected some of"
                    f" {', '.join(known)}."
                )
            if self.singles.count(name) > 1:
                raise InputError(
                    f"parameter {name!r} is to be estimated more than once; expected each name once. Drop the"
                    " repeats."
                )

    def values(self, camera: Camera) -> Float[ndarray, " k"]:
        """Their values in a camera, of each tie the first name's."""
        return np.array([_value(camera, group[0]) for group in self.groups], dtype=float)

    def moved(self, camera: Camera, step: Float[ndarray, " k"]) -> Camera:
        """The camera after a step; a focal length never turns negative (it halves instead).

        Args:
            camera: before it.
            step: (k,) one number for each parameter, in the parameter's own unit.
        """
        steps = {
            name: float(length) for group, length in zip(self.groups, step, strict=True) for name in group
        }
        own = {name: steps.pop(name) for name in INTRINSICS if name in steps}
        of_frame: dict[str, float] = {}
        for name in FRAME.keys() & steps.keys():
            length = steps.pop(name)
            for entry in FRAME[name]:
                of_frame[entry] = of_frame.get(entry, 0.0) + length
        lens = camera.lens
        if steps:
            values = dict(zip(lens.names(), lens.coefficients.tolist(), strict=True))
            lens = lens.with_coefficients(**{name: values[name] + length for name, length in steps.items()})
        frame, K = camera.lens_frame, _moved(camera.intrinsics, own)
        if isinstance(lens, FreeLens) and frame is None:
            lens = _kept_in_place(lens, camera.intrinsics, K)
        return replace(
            camera,
            intrinsics=K,
            lens=lens,
            lens_frame=_moved(frame, of_frame) if frame else None,
        )


@lru_cache(maxsize=256)
def _parsed(free: tuple[str, ...]) -> Parameters:
    """What is written."""
    cameras = {text.rpartition(":")[0] for text in free}
    if len(cameras) > 1:
        raise InputError(
            f"the parameters {', '.join(free)} belong to {len(cameras)} cameras; expected those of one."
        )
    return Parameters(tuple(tuple(text.rpartition(":")[2].split("=")) for text in free), "".join(cameras))


def _value(camera: Camera, name: str) -> float:
    """Of one parameter."""
    if name in INTRINSICS:
        return getattr(camera.intrinsics, name)
    if name in FRAME:
        return getattr(camera.lens_frame, FRAME[name][0])
    return float(camera.lens.coefficients[camera.lens.names().index(name)])


def _moved(K: Intrinsics, steps: dict[str, float]) -> Intrinsics:
    """A matrix after a step of its entries."""
    values = {name: getattr(K, name) + length for name, length in steps.items()}
    for name in FOCAL_LENGTHS:
        if name in values and not values[name] > 0:
            values[name] = 0.5 * getattr(K, name)
    return replace(K, **values) if values else K


def _kept_in_place(lens: FreeLens, before: Intrinsics, after: Intrinsics) -> FreeLens:
    """The lens with its displacement's lattice where it was in the image.

    A lattice that went with K's principal point would have to be learnt anew wherever K goes, and would seem
    to say where it is.
    """
    scale = np.array([before.fx / after.fx, before.fy / after.fy])
    shift = np.array([(before.cx - after.cx) / after.fx, (before.cy - after.cy) / after.fy])
    return replace(lens, over=Displacement(lens.over.lattice.seen_from(scale, shift), lens.over.coefficients))
