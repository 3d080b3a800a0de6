"""Every kind of target gives the camera that took its photographs."""

from __future__ import annotations

import pytest
from benchmarks.studies.kinds import KINDS, camera_error

from orthoscope.targets.table import TARGETS


def test_every_kind_is_studied():
    assert {spec.partition(":")[0] for spec in KINDS} == set(TARGETS)


@pytest.mark.slow
@pytest.mark.parametrize("spec", KINDS)
def test_a_camera_by_each_kind_is_within_two_standard_errors_of_the_truth(spec):
    error, standard_errors = camera_error(spec, 8)
    assert error < 0.2  # px
    assert standard_errors < 2.0
