"""What the README shows is what happens."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from orthoscope.cli import verbs

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def beside_photos(photos, tmp_path, monkeypatch):
    """A folder of one's own with photos/ in it."""
    shutil.copytree(photos, tmp_path / "photos")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_its_python_runs_and_leaves_what_it_says(beside_photos, capsys):
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert "off by about" in capsys.readouterr().out
    assert (beside_photos / "calibration.json").is_file()


@pytest.mark.slow
def test_its_command_runs(run, beside_photos):
    (command,) = re.findall(r"^orthoscope (.*)$", README, re.MULTILINE)
    assert run(*shlex.split(command)).code == 0
    assert len(list((beside_photos / "camera/undistorted").glob("*.png"))) == 10


def test_its_make_targets_and_verbs_and_files_are_there():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(f"\n{target}:" in makefile for target in re.findall(r"^make (\w+)", README, re.MULTILINE))
    assert set(re.findall(r"^\| `(\w+)` \|", README, re.MULTILINE)) == set(verbs.commands)
    assert all((ROOT / path).is_file() for path in re.findall(r"\]\(([^)]+)\)", README))
