"""The plumb line on made-up streets: how far off the lens of `orthoscope straighten` is, lens by lens.

    python -m benchmarks.studies.plumb_line              8 sets of streets for each lens
    python -m benchmarks.studies.plumb_line --seeds 2    fewer

Photographs are 640x480, three to a set, with noise of 3 grey levels, cables, crowns and poles (streets.py);
the distortion centre is 12 px from the image's. A lens is judged over the whole frame, corners included:
where the true camera sees what the found one makes straight, but for a homography, which no line tells.
"""

from __future__ import annotations

import argparse

import cv2
import numpy as np

from benchmarks.studies.streets import street_camera, street_photograph
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.methods.plumb_line.edges import Edge, edges_of
from orthoscope.methods.plumb_line.plumb_line import lens_of_edges
from orthoscope.models.camera import Camera
from orthoscope.models.difference import frame_grid
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.table import Brown, Division, KannalaBrandt, lens_name

__all__ = ["STREET_LENSES", "apart", "street_edges"]

PHOTOGRAPHS = 3
# By what they are and the angle across the diagonal: the lens, and the focal length in pixels.
STREET_LENSES: dict[str, tuple[Lens, float]] = {
    "no distortion": (Brown(), 520.0),
    "mild barrel": (Brown(k1=-0.08, k2=0.01), 520.0),
    "strong barrel": (Brown(k1=-0.28, k2=0.08), 520.0),
    "pincushion": (Brown(k1=0.12), 520.0),
    "strong pincushion": (Brown(k1=0.2, k2=0.05), 520.0),
    "division": (Division(l=-0.35), 520.0),
    "division, 110 degrees": (Division(l=-0.3), 400.0),
    "Kannala-Brandt, 118 degrees": (KannalaBrandt(k1=-0.03, k2=0.005), 400.0),
    "Kannala-Brandt, 157 degrees": (KannalaBrandt(k1=-0.02, k2=0.003), 300.0),
}


def street_edges(truth: Camera, seed: int, count: int = PHOTOGRAPHS) -> list[Edge]:
    """The edges of photographs of made-up streets."""
    rng = np.random.default_rng(seed)
    return [edge for i in range(count) for edge in edges_of(street_photograph(truth, rng=rng), i)]


def apart(camera: Camera, truth: Camera, pixels: Float[ndarray, "n 2"] | None = None) -> Float[ndarray, " n"]:
    """How far off a camera's straight image is over the frame, or at pixels of the photograph; but for a
    homography, which no line tells.
    """
    pixels = frame_grid(truth.image_size) if pixels is None else pixels
    found, true = camera.undistort_pixels(pixels), truth.undistort_pixels(pixels)
    to_true = cv2.findHomography(found, true, 0)[0]
    carried = cv2.perspectiveTransform(found[None], to_true)[0]
    return np.hypot(*(truth.distort_pixels(carried) - pixels).T)


def main() -> None:
    """The table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=8, help="sets of streets for each lens")
    seeds = parser.parse_args().seeds
    print("| lens | worst over the frame, px, each set | within 1 px | rms | formulas taken |")
    print("|---|---|---|---|---|")
    for name, (lens, focal) in STREET_LENSES.items():
        truth = street_camera(lens, focal=focal)
        found = [lens_of_edges(street_edges(truth, seed), truth.image_size) for seed in range(seeds)]
        off = [apart(one.camera, truth) for one in found]
        worst = [float(one.max()) for one in off]
        rms = float(np.sqrt((np.concatenate(off) ** 2).mean()))
        taken = ", ".join(sorted({lens_name(one.camera.lens) for one in found}))
        each = " ".join(f"{one:.2f}" for one in worst)
        print(
            f"| {name} | {each} | {sum(one < 1 for one in worst)} of {seeds} | {rms:.2f} | {taken} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
