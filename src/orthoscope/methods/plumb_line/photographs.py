"""The lens of photographs, from their edges: photographs in, a plumb line's lens out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

from orthoscope.files.images import read_image
from orthoscope.geometry.arrays import InputError
from orthoscope.methods.plumb_line.edges import Edge, edges_of
from orthoscope.methods.plumb_line.plumb_line import PlumbLine, lens_of_edges

__all__ = ["lens_of_photographs"]


def lens_of_photographs(
    paths: Sequence[Path],
    *,
    lens: str = "auto",
    executor: Executor | None = None,
    progress: Callable[..., None] | None = None,
) -> PlumbLine:
    """The lens that makes the edges in one camera's photographs straight.

    Args:
        paths: of the photographs, of one size.
        lens: as `lens_of_edges` takes it.
        executor: where photographs are looked at; by default here, one after the other.
        progress: called with (photographs done, photographs).
    Raises:
        CalibrationError: too few edges agree on a lens.
        InputError: a photograph cannot be read or has another size than the first.
    """
    found: list[Edge] = []
    sizes: list[tuple[int, int]] = []
    look = partial(_looked_at, paths)
    for size, edges in (executor.map if executor else map)(look, range(len(paths))):
        sizes.append(size)
        found += edges
        if size != sizes[0]:
            raise InputError(
                f"{paths[len(sizes) - 1].name} is {size[0]}x{size[1]} pixels and {paths[0].name}"
                f" {sizes[0][0]}x{sizes[0][1]}; one lens needs photographs of one size. Straighten each size"
                " alone."
            )
        if progress:
            progress(len(sizes), len(paths))
    return lens_of_edges(found, sizes[0], lens=lens)


def _looked_at(paths: Sequence[Path], number: int) -> tuple[tuple[int, int], list[Edge]]:
    """The size and the edges of a photograph."""
    image = read_image(paths[number], grey=True)
    return (image.shape[1], image.shape[0]), edges_of(image, number)
