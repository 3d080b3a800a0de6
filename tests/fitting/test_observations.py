"""The table of corners: samples of it, and poses back in the order of the views."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.scenes import NARROW, photographed, some_corners
from orthoscope.fitting.observations import Observations, Poses
from orthoscope.geometry.pose import rotation_from_vector

DETECTIONS = some_corners(photographed(NARROW, 7, noise_px=0.1), (0.2, 1.0))


@pytest.mark.parametrize("corners", [1, 20, 54])
def test_a_sample_has_of_each_view_some_of_its_corners_with_their_own_pixels(corners):
    whole = Observations.of(DETECTIONS)
    sample = whole.thinned(corners)
    assert_array_equal(sample.counts, np.minimum(whole.counts, corners))
    assert_array_equal(sample.present.sum(1), sample.counts)
    for row, view in enumerate(sample.order):
        seen = sample.present[row] > 0
        pixels = dict(
            zip(DETECTIONS.views[view].ids.tolist(), DETECTIONS.views[view].pixels.tolist(), strict=True)
        )
        ids = sample.ids[row, seen].tolist()
        assert len(set(ids)) == len(ids)
        assert [pixels[i] for i in ids] == sample.pixels()[row, seen].tolist()


def test_a_sample_as_large_as_the_largest_view_is_the_table_itself():
    whole = Observations.of(DETECTIONS)
    assert whole.thinned(int(whole.counts.max())) is whole


def test_a_sample_is_the_same_every_time():
    first, second = (Observations.of(DETECTIONS).thinned(10) for _ in range(2))
    assert_array_equal(first.ids, second.ids)


def test_poses_go_to_rows_and_come_back_in_the_order_of_the_views_and_cannot_be_written():
    observations = Observations.of(DETECTIONS)
    assert (np.diff(observations.order) < 0).any()  # views with fewer corners stand behind
    vectors = np.random.default_rng(0).normal(size=(2, 7, 3))
    there = observations.poses_in_order(Poses(rotation_from_vector(vectors[0]), vectors[1]))
    back = observations.poses_in_order(observations.poses_of(there))
    for pose, same in zip(there, back, strict=True):
        assert_allclose(same.rotation, pose.rotation, atol=1e-15)  # made orthonormal twice: rounding
        assert_array_equal(same.translation, pose.translation)
        assert not same.rotation.flags.writeable
        assert not same.translation.flags.writeable
