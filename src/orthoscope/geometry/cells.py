"""The photograph's frame in nearly square cells, and what falls into each.

Values arrive one for each corner; cells without corners are NaN, as everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["Cells", "cells_for"]


@dataclass(frozen=True)
class Cells:
    """Cells of one size over the whole frame, edges included.

    Attributes:
        image_size: (width, height) pixels.
        columns: how many cells stand side by side.
        rows: how many stand one above the other.
    """

    image_size: tuple[int, int]
    columns: int
    rows: int

    @property
    def x_edges(self) -> Float[ndarray, " c"]:
        """Left to right, columns + 1 of them, pixels."""
        return np.linspace(-0.5, self.image_size[0] - 0.5, self.columns + 1)

    @property
    def y_edges(self) -> Float[ndarray, " r"]:
        """Top to bottom, rows + 1 of them, pixels."""
        return np.linspace(-0.5, self.image_size[1] - 0.5, self.rows + 1)

    @property
    def centres(self) -> Float[ndarray, "rows columns 2"]:
        """The middle of each cell, pixels."""
        x, y = (0.5 * (edges[1:] + edges[:-1]) for edges in (self.x_edges, self.y_edges))
        return np.stack(np.meshgrid(x, y), axis=-1)

    def of(self, pixels: Float[ndarray, "n 2"]) -> Int[ndarray, " n"]:
        """The number of each pixel's cell, row by row; outside the frame that of the nearest cell."""
        counts = np.array([self.columns, self.rows])
        cell = np.floor((pixels + 0.5) / np.array(self.image_size) * counts).astype(np.int64)
        cell = np.clip(cell, 0, counts - 1)
        return cell[:, 1] * self.columns + cell[:, 0]

    def count(self, pixels: Float[ndarray, "n 2"]) -> Int[ndarray, "rows columns"]:
        """How many pixels fall into each cell."""
        return np.bincount(self.of(pixels), minlength=self.rows * self.columns).reshape(
            self.rows, self.columns
        )

    def mean(
        self, pixels: Float[ndarray, "n 2"], values: Float[ndarray, " n"]
    ) -> Float[ndarray, "rows columns"]:
        """The mean of the values in each cell; NaN where there are none.

        Args:
            pixels: where the values are, (n,2).
            values: one for each pixel.
        """
        total = np.bincount(self.of(pixels), weights=values, minlength=self.rows * self.columns).reshape(
            self.rows, self.columns
        )
        count = self.count(pixels)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def cells_for(image_size: tuple[int, int], wanted: int) -> Cells:
    """About `wanted` nearly square cells over a frame of image_size (width, height) pixels."""
    width, height = image_size
    columns = max(1, round(np.sqrt(wanted * width / height)))
    return Cells(image_size, columns, max(1, round(columns * height / width)))
