"""BLAS has one thread while our functions run, and as many as before afterwards."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from orthoscope import METHODS, calibrate, evaluate
from orthoscope.machine.blas import one_thread, with_one_thread
from orthoscope.simulation.scene import paper_scene, simulate_detections


def threads_of_blas() -> set[int]:
    return {found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    """As a user has them who has set nothing, on a machine of two cores."""
    with threadpool_limits(limits=2, user_api="blas"):
        if threads_of_blas() != {2}:
            pytest.skip("this BLAS cannot be told how many threads to have")
        yield


def test_inside_there_is_one_and_afterwards_there_are_as_many_as_before():
    with one_thread:
        assert threads_of_blas() == {1}
        with one_thread:
            assert threads_of_blas() == {1}
        assert threads_of_blas() == {1}
    assert threads_of_blas() == {2}


def test_an_error_gives_them_back_too():
    @with_one_thread
    def fails() -> None:
        raise ValueError

    with pytest.raises(ValueError):
        fails()
    assert threads_of_blas() == {2}


SEVERAL = """
import threading
import numpy
from threadpoolctl import threadpool_info
from orthoscope.machine.blas import one_thread

threads_of_blas = lambda: {found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}
begun, end, seen = threading.Barrier(3), threading.Event(), [threads_of_blas()]

def work(wait):
    with one_thread:
        begun.wait()
        wait and end.wait()
        seen.append(threads_of_blas())

workers = [threading.Thread(target=work, args=(wait,)) for wait in (False, True)]
for worker in workers:
    worker.start()
begun.wait()
workers[0].join()
seen.append(threads_of_blas())  # the second is still inside
end.set()
workers[1].join()
seen.append(threads_of_blas())
with one_thread:
    seen.append(threads_of_blas())
seen.append(threads_of_blas())
print(*(max(each) for each in seen))
"""


def test_several_at_the_same_time_give_them_back_when_the_last_has_ended():
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", SEVERAL], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.split() == ["2", "1", "1", "1", "2", "1", "2"]


def test_calibrating_and_judging_see_one_thread(monkeypatch):
    detections = simulate_detections(
        paper_scene("low", count=4, rng=np.random.default_rng(0)), noise_px=0.1, rng=np.random.default_rng(1)
    )
    seen = []
    fccm = METHODS["fccm"]

    @functools.wraps(fccm)
    def looking(*args, **settings):
        seen.append(threads_of_blas())
        return fccm(*args, **settings)

    monkeypatch.setitem(METHODS.data, "fccm", looking)
    evaluate(calibrate(detections, method="fccm"), folds=2)
    assert seen == [{1}] * 3
    assert threads_of_blas() == {2}


def test_every_method_is_pinned_by_itself():
    assert all(hasattr(METHODS[name], "__wrapped__") for name in METHODS)
