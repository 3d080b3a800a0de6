"""A verb loads what it uses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from orthoscope.formats.own.json import save
from orthoscope.simulation.render import demo_scene
from orthoscope.simulation.scene import simulate_detections

LOADED = """
import sys
from orthoscope.cli import verbs
verbs(sys.argv[1:], standalone_mode=False)
print("LOADED", *sys.modules)
"""


def test_calibrating_from_corners_loads_no_opencv_no_progress_bar_and_one_method(tmp_path: Path):
    save(
        simulate_detections(demo_scene(), noise_px=0.1, rng=np.random.default_rng(0)),
        tmp_path / "detections.json",
    )
    command = [
        "calibrate",
        tmp_path / "detections.json",
        "--method",
        "fccm",
        "--no-report",
        "-o",
        tmp_path / "camera",
    ]
    done = subprocess.run(
        [sys.executable, "-c", LOADED, *command], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.partition("LOADED")[2].split())
    assert "orthoscope.methods.fccm" in loaded
    assert not loaded & {
        "cv2",
        "tqdm",
        "scipy",
        "matplotlib",
        "jinja2",
        "orthoscope.methods.decoupled.decoupled",
        "orthoscope.methods.mldc.mldc",
    }
