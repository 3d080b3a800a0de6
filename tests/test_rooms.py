"""The contract between the rooms has been seen to break."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


def lint_imports(tree: Path) -> subprocess.CompletedProcess[str]:
    """Run import-linter over a tree, the package imported from that tree."""
    return subprocess.run(
        [
            sys.executable,
            "-c",
            (
                "import sys; from importlinter.cli import lint_imports_command as lint;"
                " sys.exit(lint(['--no-cache']))"
            ),
        ],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree / "src")},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of what import-linter looks at."""
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def test_the_contract_between_the_rooms_is_kept(tree):
    result = lint_imports(tree)
    assert result.returncode == 0, result.stdout + result.stderr


def test_an_import_of_a_room_above_breaks_the_contract(tree):
    planted = tree / "src" / "orthoscope" / "geometry" / "pose.py"
    planted.write_text(planted.read_text() + "\n\nfrom orthoscope.models import camera  # noqa\n")
    result = lint_imports(tree)
    assert result.returncode != 0
    assert "orthoscope.geometry.pose -> orthoscope.models.camera" in result.stdout


def test_a_new_folder_that_the_contract_does_not_name_breaks_it(tree):
    attic = tree / "src" / "orthoscope" / "attic"
    attic.mkdir()
    (attic / "__init__.py").write_text("")
    assert lint_imports(tree).returncode != 0
