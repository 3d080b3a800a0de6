"""What a tool's file is: the record `Format`, the lenses that it holds and what goes into a file or comes out
of it.

Everything that help texts, errors, the choice of a formula and docs/formats.md say of a tool is in its
record. A record's lenses are `Holding`s: our name of a lens, the tool's word, and the coefficients in the
tool's order. What a camera has beyond them (a coefficient that is not zero, a skew, two focal lengths, a
centre of its own) the tool cannot hold; `export` then fits what it can. Cameras in `Contents` have the tool's
pixel origin; `export` and `load` shift them, so that no tool's file does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from orthoscope.formats.syntax import Document
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import FREE, LENSES, lens_name

__all__ = ["Contents", "Files", "Format", "Holding", "share_beyond", "shifted"]

Files = Mapping[Path, str | bytes]
# Cells across and down by which it is said how much of the frame a tool cannot show.
BEYOND_GRID = (64, 48)


@dataclass(frozen=True, eq=False)
class Contents:
    """What a tool's file holds.

    Attributes:
        camera: with the tool's pixel origin.
        poses: camera_from_world of each photograph, by its name; the world is the target's frame.
        name: of the camera, where the tool names cameras.
        trusted: pixels of the corner that the camera was made from, where they are known.
    """

    camera: Camera
    poses: Mapping[str, Pose] = field(default_factory=dict)
    name: str = "camera"
    trusted: Float[ndarray, "n 2"] | None = None


class Holding(NamedTuple):
    """A lens that a tool has.

    Attributes:
        lens: its name in LENSES.
        word: the tool's name for it.
        coefficients: in the tool's order; a name that the lens does not have is written as 0.
        free: those that a fit for the tool moves; by default the lens's own choice among `coefficients`.
        farthest_deg: the angle from the axis past which the tool's formula gives no image, or a wrong one.
        written: whether a camera is written so; some words are only read.
        note: what must be known by who reads it; empty where nothing.
    """

    lens: str
    word: str
    coefficients: tuple[str, ...]
    free: tuple[str, ...] = ()
    farthest_deg: float = float("inf")
    written: bool = True
    note: str = ""

    def holds(self, lens: Lens) -> bool:
        """Whether this is the lens to the last digit."""
        if lens_name(lens) != self.lens or not self.written:
            return False
        usual = LENSES[self.lens]() if self.lens != FREE else lens
        return all(
            name in self.coefficients or value == wanted
            for name, value, wanted in zip(lens.names(), lens.coefficients, usual.coefficients, strict=True)
        )

    def values(self, lens: Lens) -> list[float]:
        """The coefficients of a lens in the tool's order."""
        known = dict(zip(lens.names(), lens.coefficients.tolist(), strict=True))
        return [known.get(name, 0.0) for name in self.coefficients]

    def description(self) -> str:
        """The lens as --lens takes it, with what a fit moves, such as `brown:k1,k2,p1,p2`."""
        free = self.free or tuple(name for name in LENSES[self.lens].free if name in self.coefficients)
        return self.lens if free == LENSES[self.lens].free else f"{self.lens}:{','.join(free)}"


@dataclass(frozen=True, eq=False)
class Format:
    """A tool's file.

    Attributes:
        name: as `--to` takes it.
        title: the tool and its file, for people.
        suffixes: of its files, the usual one first; where there are several, the suffix says which is
            written.
        holdings: the lenses that it has, those to be preferred first.
        recognises: whether a document is such a file, by its content.
        read: the cameras of such a file, by name; the last argument is an image size for files that lack it.
        write: the files, by place, for contents and the place that was asked for.
        skew: whether pixel axes may be oblique.
        two_focals: whether fx and fy may differ.
        own_centre: whether a lens may have a distortion centre of its own.
        pixel_origin: where the centre of the first pixel is, in the tool's pixels.
        poses: whether the photographs' poses go with the camera.
        knows_size: whether the file says how large its images are.
        remarks: what else is lost or must be known, a sentence or none.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    holdings: tuple[Holding, ...]
    recognises: Callable[[Document], bool]
    read: Callable[[Document, tuple[int, int] | None], Mapping[str, Contents]]
    write: Callable[[Contents, Path], Files]
    skew: bool = False
    two_focals: bool = True
    own_centre: bool = False
    pixel_origin: float = 0.0
    poses: bool = False
    knows_size: bool = True
    remarks: str = ""

    @property
    def lenses(self) -> tuple[str, ...]:
        """The lenses that a calibration for this tool may choose among, as --lens takes them; each once."""
        richest: dict[str, Holding] = {}
        for holding in self.holdings:
            known = richest.get(holding.lens)
            if (
                holding.written
                and holding.lens != FREE
                and (known is None or len(holding.coefficients) > len(known.coefficients))
            ):
                richest[holding.lens] = holding
        return tuple(holding.description() for holding in richest.values())

    @property
    def lens_names(self) -> tuple[str, ...]:
        """The lenses, by our names."""
        return tuple(dict.fromkeys(holding.lens for holding in self.holdings))

    def holding(self, lens: Lens) -> Holding | None:
        """How this tool holds a lens exactly; None where it cannot."""
        return next((holding for holding in self.holdings if holding.holds(lens)), None)

    def lens(self, word: str, values: Sequence[float], document: Document) -> Lens:
        """Our lens for the tool's word and coefficients.

        Raises:
            InputError: the tool has no such lens, or it has another number of coefficients.
        """
        words = [holding for holding in self.holdings if holding.word == word]
        for holding in words:
            if len(holding.coefficients) != len(values):
                continue
            kind = LENSES[holding.lens]
            given = dict(zip(holding.coefficients, values, strict=True))
            if all(name in kind.names() or value == 0.0 for name, value in given.items()):
                return kind().with_coefficients(
                    **{name: value for name, value in given.items() if name in kind.names()}
                )
        known = ", ".join(dict.fromkeys(holding.word for holding in self.holdings if holding.word))
        if not words:
            raise document.refuse(f"has a lens {word[:40]!r}; of {self.title} these are known: {known}")
        counts = ", ".join(str(n) for n in sorted({len(holding.coefficients) for holding in words}))
        raise document.refuse(f"has {len(values)} distortion coefficients of {word}; expected {counts}")

    def lacks(self, camera: Camera) -> str:
        """What of a camera this tool cannot hold, in words; empty where it holds all."""
        if camera.intrinsics.skew != 0.0 and not self.skew:
            return f"a skew of {camera.intrinsics.skew:g} px"
        if camera.lens_frame is not None and not self.own_centre:
            return "a distortion centre of its own"
        if camera.intrinsics.fx != camera.intrinsics.fy and not self.two_focals:
            return "two focal lengths"
        if self.holding(camera.lens) is None:
            coefficients = isinstance(camera.lens, FreeLens) or lens_name(camera.lens) not in {
                holding.lens for holding in self.holdings
            }
            return (
                f"this {lens_name(camera.lens)} lens"
                if coefficients
                else (f"all coefficients of this {lens_name(camera.lens)} lens")
            )
        return ""


def shifted(camera: Camera, by: float) -> Camera:
    """The same camera where the centre of the first pixel is called `by` farther right and down."""
    if by == 0.0:
        return camera

    def moved(intrinsics: Intrinsics) -> Intrinsics:
        return replace(intrinsics, cx=intrinsics.cx + by, cy=intrinsics.cy + by)

    frame = camera.lens_frame
    return replace(camera, intrinsics=moved(camera.intrinsics), lens_frame=frame and moved(frame))


def share_beyond(camera: Camera, farthest_deg: float) -> float:
    """The share of the frame's pixels that have rays whose rays lie farther from the axis than an angle."""
    if not np.isfinite(farthest_deg):
        return 0.0
    (width, height), (across, down) = camera.image_size, BEYOND_GRID
    x, y = np.meshgrid((np.arange(across) + 0.5) * width / across, (np.arange(down) + 0.5) * height / down)
    rays = camera.unproject(np.stack([x.ravel(), y.ravel()], axis=-1) - 0.5)
    rays = rays[np.isfinite(rays).all(1)]
    return float((rays[:, 2] < np.cos(np.deg2rad(farthest_deg))).mean()) if len(rays) else 0.0
