"""discorpy as a peer: a photograph made straight by its backward polynomial model."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import discorpy.post.postprocessing as post  # pyright: ignore[reportMissingImports]  # lives in an environment of its own
import imageio.v3 as imageio  # pyright: ignore[reportMissingImports]  # comes with discorpy
from served import serve, timed


def straighten(path: str, times: int, centre: list[float], factors: list[float]) -> dict[str, Any]:
    """One photograph made straight so many times."""
    grey = imageio.imread(path, mode="L")
    return timed(lambda: [post.unwarp_image_backward(grey, *centre, factors) for _ in range(times)])[1]


if __name__ == "__main__":
    serve({"straighten": straighten, "version": lambda: {"version": f"discorpy {version('discorpy')}"}})
