"""Which samples `make test` runs, where each takes a while: the first; the others are slow tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pytest

__all__ = ["first_quick"]


def first_quick(samples: Iterable[Any] | Mapping[str, Any]) -> list[Any]:
    """Samples for `parametrize`, all but the first marked slow.

    Args:
        samples: values, or tuples of values; by name where they have names.
    """
    named = samples.items() if isinstance(samples, Mapping) else ((None, value) for value in samples)
    return [
        pytest.param(
            *(value if isinstance(value, tuple) else (value,)), id=name, marks=[pytest.mark.slow] if i else []
        )
        for i, (name, value) in enumerate(named)
    ]
