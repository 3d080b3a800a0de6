"""What every test stands on: shapes in annotations are checked, hypothesis repeats itself, real photographs
where they are present.
"""

from __future__ import annotations

import os
from pathlib import Path

import jaxtyping
import pytest
from hypothesis import settings

from helpers.shapes import begin_test, sampled

jaxtyping.jaxtyped = sampled  # which the hook puts on functions and classes
jaxtyping.install_import_hook("orthoscope", "helpers.shapes.checked")  # before anything imports orthoscope

settings.register_profile("orthoscope", deadline=None, derandomize=True, max_examples=30)
settings.load_profile("orthoscope")


def pytest_runtest_setup() -> None:
    """Calls are counted from the start of each test."""
    begin_test()


@pytest.fixture(scope="session")
def datasets() -> Path:
    """The folder of real photographs; a test that asks for it is skipped where there is none."""
    root = Path(__file__).resolve().parent.parent
    folder = root / os.environ.get("ORTHOSCOPE_DATASETS", "../shared/datasets")
    if not folder.is_dir():
        pytest.skip(f"no photographs at {folder}; set ORTHOSCOPE_DATASETS to the folder that has them")
    return folder
