"""A free lens is its base and a displacement of the base's image, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from helpers.laws import FREE_LENSES_TO_TRY, displaced, rays_over
from orthoscope.geometry.arrays import InputError
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.table import FREE, Brown, KannalaBrandt, lens_name

for_every_free_lens = pytest.mark.parametrize(
    "lens", FREE_LENSES_TO_TRY.values(), ids=FREE_LENSES_TO_TRY.keys()
)


@for_every_free_lens
def test_its_image_is_that_of_its_base_displaced(lens):
    rays = rays_over(lens, last=0.9)
    plane = lens.base.distort(rays)
    seen = np.isfinite(plane).all(1)
    assert_array_equal(lens.distort(rays)[seen], plane[seen] + lens.over.at(*plane[seen].T)[0])


@for_every_free_lens
def test_its_coefficients_are_those_of_its_base(lens):
    assert lens.names() == lens.base.names()
    assert lens.free == lens.base.free
    assert lens.chart is lens.base.chart
    changed = lens.with_coefficients(k1=0.123)
    assert changed.base.k1 == 0.123
    assert changed.over is lens.over
    assert lens_name(lens) == FREE


def test_away_from_its_lattice_it_is_its_base():
    base = KannalaBrandt(k1=-0.02, k2=0.003)
    lens = displaced(base, (0.5, 0.4), 0.02, cells=(10, 8))  # with three cells around it ends at 0.8 and 0.7
    rays = base.chart.lift(np.array([0.9, -1.2, 0.0, 0.1]), np.array([0.0, 0.5, 0.8, -2.5]))
    assert_array_equal(lens.distort(rays), base.distort(rays))
    assert_allclose(lens.undistort(base.distort(rays)), rays, atol=1e-14)


def test_a_displacement_sees_past_90_degrees():
    lens = FREE_LENSES_TO_TRY["free over kannala_brandt"]
    rays = lens.chart.lift(np.array([1.9, -1.8]), np.array([0.1, 0.4]))
    assert (rays[:, 2] < 0).all()
    assert (np.hypot(*(lens.distort(rays) - lens.base.distort(rays)).T) > 1e-3).all()
    assert_allclose(lens.undistort(lens.distort(rays)), rays, atol=1e-13)


def test_where_a_displacement_pushes_the_image_out_more_is_seen_than_by_its_base():
    base = Brown(k1=-0.2)  # folds at s = 1.29, where r_d = 0.86
    lens = displaced(base, (1.0, 1.0), 0.0)
    rather = FreeLens(
        base, type(lens.over)(lens.over.lattice, np.full((lens.over.lattice.splines, 2), [0.1, 0.0]))
    )
    rays = rays_over(base, last=0.999)
    pushed = rather.distort(rays)
    beyond = np.hypot(*pushed.T) > 0.87  # past all that the base images
    assert beyond.sum() > 20
    assert_allclose(
        rather.undistort(pushed[beyond]), rays[beyond], atol=1e-9
    )  # beside the fold the inverse is steep


def test_a_free_lens_over_a_free_lens_is_refused():
    lens = FREE_LENSES_TO_TRY["free over brown"]
    with pytest.raises(InputError, match="the base of a free lens is a free lens; expected a formula"):
        FreeLens(lens, lens.over)
