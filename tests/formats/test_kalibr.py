"""Kalibr's camchain: the models that bring their own coefficients."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from orthoscope.formats.load import load_camera
from orthoscope.geometry.arrays import InputError


def test_kalibrs_models_without_distortion_are_read(tmp_path):
    """ds as Kalibr's documentation shows it; omni is Mei's: x / (z + xi |r|)."""
    (tmp_path / "chain.yaml").write_text(
        "cam0:\n  camera_model: ds\n  distortion_coeffs: []\n  distortion_model: none\n"
        "  intrinsics: [-0.19, 0.59, 317.5, 316.1, 724.8, 546.5]\n  resolution: [1440, 1080]\n"
        "cam1:\n  camera_model: omni\n  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n  distortion_model: radtan\n"
        "  intrinsics: [1.2, 700.0, 701.0, 320.0, 240.0]\n  resolution: [640, 480]\n"
    )
    ds, omni = (load_camera(tmp_path / f"chain.yaml#cam{i}") for i in (0, 1))
    assert ds.intrinsics.as_tuple()[:4] == (317.5, 316.1, 724.8, 546.5)
    assert dict(zip(ds.lens.names(), ds.lens.coefficients, strict=True)) == {"xi": -0.19, "alpha": 0.59}
    x, y, z = rays = np.array([0.3, -0.2, 0.9])
    below = z + 1.2 * np.linalg.norm(rays)
    assert_allclose(omni.project(rays), [700.0 * x / below + 320.0, 701.0 * y / below + 240.0], rtol=1e-13)


def test_kalibrs_omni_with_distortion_is_refused_with_what_to_do(tmp_path):
    (tmp_path / "chain.yaml").write_text(
        "cam0:\n  camera_model: omni\n  distortion_coeffs: [-0.1, 0.0, 0.0, 0.0]\n"
        "  distortion_model: radtan\n"
        "  intrinsics: [1.2, 700.0, 701.0, 320.0, 240.0]\n  resolution: [640, 480]\n"
    )
    with pytest.raises(InputError, match=r"omni and a distortion 'radtan' on top; expected none.*ds-none"):
        load_camera(tmp_path / "chain.yaml")
