"""Work in threads, in processes and on a cluster gives what one alone gives, and nobody stays behind when it
is stopped.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor
from functools import partial
from operator import call

import pytest

from orthoscope.cli.shared.executors import cluster, processes, threads
from orthoscope.paper.entries import PAPER
from orthoscope.paper.trials import Condition, Study, trial_outcomes

TARGET = "chessboard:9x6:25mm"
LIMIT = 60.0  # seconds that a busy machine may take to start or to end a process
STUDY = Study("noise", (0.5,), (Condition(0.5, (6, 9)),), PAPER[:1])
TRIALS = [partial(trial_outcomes, STUDY, "low", seed=0, trial=trial) for trial in range(24)]

pytest.importorskip("psutil")
import psutil  # noqa: E402  comes with Dask


def wait_until(true, what: str) -> None:
    """Waits for something to become true."""
    end = time.monotonic() + LIMIT
    while not true():
        assert time.monotonic() < end, f"{what} did not happen in {LIMIT:.0f} s"
        time.sleep(0.05)


def test_one_job_starts_no_process():
    with processes(1) as executor:
        assert executor is None


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_what_waits_is_dropped_when_a_block_is_left_by_an_error(error):
    begun, hold = [], threading.Event()

    def work(i):
        begun.append(i)
        hold.wait(LIMIT)

    def leave(executor: Executor):
        for i in range(10):
            executor.submit(work, i)
        wait_until(lambda: begun, "the first piece of work")
        threading.Timer(0.2, hold.set).start()
        raise error

    with pytest.raises(error), threads(1) as executor:
        leave(executor)
    assert begun == [0]


def test_sigterm_stops_a_block_as_ctrl_c_does_and_then_is_what_it_was():
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), threads(1):
        wait_until(lambda: os.kill(os.getpid(), signal.SIGTERM), "the end of this block")
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL], ids=lambda how: how.name)
def test_nobody_stays_behind_when_a_verb_is_stopped(tmp_path, how):
    code = (
        "from orthoscope.cli import main; import sys; sys.argv = ['orthoscope', 'paper', '--jobs', '2', '-o',"
        " 'out']; main()"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, stderr=subprocess.PIPE)
    try:
        known = psutil.Process(parent.pid)
        wait_until(
            lambda: (
                len(known.children()) >= 2 and sum(child.cpu_times().user for child in known.children()) > 1.0
            ),
            "work",
        )
        children = known.children(recursive=True)
        parent.send_signal(how)
        _, said = parent.communicate(timeout=LIMIT)
        assert psutil.wait_procs(children, timeout=LIMIT)[1] == []
    finally:
        parent.kill()
    assert list(tmp_path.iterdir()) == []
    if how != signal.SIGKILL:
        assert parent.returncode == 130
        assert said.decode().splitlines()[-1] == "stopped; files already written are whole"


def test_a_cluster_that_is_not_there_is_named(run, tmp_path, monkeypatch):
    monkeypatch.setattr("orthoscope.cli.shared.executors.ANSWER_TIMEOUT", 0.5)
    result = run(
        "detect", tmp_path, "--target", TARGET, "--cluster", "tcp://127.0.0.1:9", "-o", tmp_path / "out.json"
    )
    assert result.code == 2
    assert "no Dask scheduler answers at 'tcp://127.0.0.1:9'" in result.err


def test_without_dask_its_option_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = run(
        "detect", tmp_path, "--target", TARGET, "--cluster", "tcp://127.0.0.1:9", "-o", tmp_path / "out.json"
    )
    assert result.code == 2
    assert "pip install 'orthoscope[cluster]'" in result.err


@pytest.fixture
def dask(tmp_path_factory):
    """The address of a running scheduler, and its two workers, each a process of its own."""
    folder = tmp_path_factory.mktemp("dask")
    known = folder / "scheduler.json"
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

    def start(module: str, *options: str) -> subprocess.Popen:
        command = [
            sys.executable,
            "-m",
            f"distributed.cli.{module}",
            "--scheduler-file",
            str(known),
            "--no-dashboard",
            *options,
        ]
        return subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, **one},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    scheduler = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
    workers = [
        start(
            "dask_worker", "--no-nanny", "--nthreads", "1", "--local-directory", str(folder), "--name", name
        )
        for name in "ab"
    ]
    from distributed import Client

    try:
        wait_until(known.is_file, "a scheduler")
        with Client(scheduler_file=str(known), set_as_default=False) as client:
            client.wait_for_workers(2, timeout=LIMIT)
            address = client.scheduler.address
        yield address, workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_in_the_middle_gives_all_results_and_the_same(dask):
    address, (doomed, spared) = dask
    alone, shared = [trial() for trial in TRIALS], []
    with cluster(address) as executor:
        for outcome in executor.map(call, TRIALS):
            shared.append(outcome)
            if len(shared) == 2:
                doomed.kill()
                doomed.wait()
    assert repr(shared) == repr(alone)  # as text, so that NaN is like NaN
    assert len(shared) == len(TRIALS)
    assert spared.poll() is None


@pytest.mark.slow
def test_verbs_give_the_same_files_on_a_cluster_as_here(run, dask, photos, calibrated, tmp_path):
    address, _ = dask
    for name, where in {"here": ("--jobs", 2), "there": ("--cluster", address)}.items():
        out = tmp_path / name
        assert run("detect", photos, "--target", TARGET, *where, "-o", out / "detections.json").code == 0
        assert (
            run("undistort", calibrated / "calibration.json", photos, *where, "-o", out / "straight").code
            == 0
        )
        judged = run("evaluate", calibrated / "calibration.json", "--folds", 5, "--json", *where)
        assert judged.code == 0
        (out / "evaluation.json").write_text(judged.out)
    here, there = (
        sorted(path for path in (tmp_path / name).rglob("*") if path.is_file()) for name in ("here", "there")
    )
    assert [path.name for path in here] == [path.name for path in there]
    assert len(here) == 14  # detections, evaluation, camera, ten pictures and their list
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(here, there, strict=True))
