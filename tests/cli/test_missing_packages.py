"""Where a package that is installed apart is not there, one sentence says which and how."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
WITHOUT = "import sys; sys.modules['cv2'] = None; "


def run(script: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WITHOUT + script], capture_output=True, text=True, check=False
    )


def test_no_flavour_of_opencv_is_a_dependency_so_that_none_is_replaced():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert not [name for name in project["dependencies"] if "opencv" in name]
    assert {"opencv", "opencv-contrib"} <= project["optional-dependencies"].keys()


def test_without_opencv_the_command_line_says_which_to_install(tmp_path):
    (tmp_path / "a.png").write_bytes(b"")
    arguments = ["orthoscope", "detect", str(tmp_path / "a.png"), "--target", "chessboard:9x6:25mm"]
    told = run(f"sys.argv = {arguments!r}; from orthoscope.cli import main; main()")
    assert told.returncode == 2, told.stderr
    assert told.stderr.startswith("orthoscope: OpenCV is not installed; expected any flavour of it")
    assert len(told.stderr.splitlines()) == 1


def test_without_opencv_python_says_which_to_install():
    told = run("import orthoscope; orthoscope.detect")
    assert "pip install 'orthoscope[opencv]'" in told.stderr


def test_without_opencv_cameras_are_still_read_and_written(tmp_path):
    told = run(
        "import orthoscope as o; from orthoscope.models.lenses.table import Brown;"
        " c = o.Camera((640, 480), o.Intrinsics(500.0, 500.0, 320.0, 240.0), Brown(k1=-0.1));"
        f" o.export(c, {str(tmp_path / 'a.yaml')!r}, 'opencv');"
        f" print(o.load_camera({str(tmp_path / 'a.yaml')!r}))"
    )
    assert "Camera(640x480" in told.stdout, told.stderr
