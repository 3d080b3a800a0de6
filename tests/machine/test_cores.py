"""How many things are done at the same time."""

from __future__ import annotations

import os

import pytest

from orthoscope.machine.cores import at_once


def test_what_is_asked_for_counts_else_the_cores_that_the_process_may_use(monkeypatch: pytest.MonkeyPatch):
    assert at_once(7) == 7
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3}, raising=False)
    assert at_once() == 1
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert at_once() == 1
