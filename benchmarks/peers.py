"""The peers: where each lives, a process that does what it is asked, and a plain reason where there is none.

A worker (workers/) reads requests from its stdin and answers on its stdout, so a peer needs only a Python
that can import it.
"""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["PEERS", "Peer", "Peers"]

HERE = Path(__file__).resolve().parent
ENVIRONMENTS = HERE / ".peers"  # made by `make bench-peers`
PATIENCE = 120.0  # seconds for one answer; whoever takes longer is stopped and said to have failed
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


class Peer(NamedTuple):
    """The Python that a peer lives in, and its worker."""

    python: Path
    worker: str


PEERS = {
    "orthoscope": Peer(Path(sys.executable), "orthoscope_worker.py"),
    "OpenCV": Peer(Path(sys.executable), "opencv_worker.py"),
    "lensboy": Peer(ENVIRONMENTS / "lensboy/bin/python", "lensboy_worker.py"),
    "discorpy": Peer(ENVIRONMENTS / "discorpy/bin/python", "discorpy_worker.py"),
    "mrcal": Peer(Path("/usr/bin/python3"), "mrcal_worker.py"),
    "mrgingham": Peer(Path(sys.executable), "mrgingham_worker.py"),
}


class Peers:
    """Running workers, started when they are first asked; use it in a `with`.

    versions: what each one that was asked is.  missing: why the others cannot be asked.
    """

    def __init__(self, table: dict[str, Peer] | None = None) -> None:
        self.table = PEERS if table is None else table
        self.versions: dict[str, str] = {}
        self.missing: dict[str, str] = {}
        self._running: dict[str, subprocess.Popen[str]] = {}

    def __enter__(self) -> Peers:
        return self

    def __exit__(self, *_: object) -> None:
        for name in list(self._running):
            self.stop(name)

    def has(self, name: str) -> bool:
        """Whether a peer can be asked."""
        if name not in self.versions and name not in self.missing:
            answer = self._tell(name, {"task": "version"})
            if "failed" in answer:
                self.missing[name] = answer["failed"]
            else:
                self.versions[name] = answer["version"]
        return name in self.versions

    def ask(self, name: str, task: str, **settings: Any) -> dict[str, Any]:
        """What the peer answers; {"failed": why} where it is missing or cannot."""
        if not self.has(name):
            return {"failed": self.missing[name]}
        return self._tell(name, {"task": task, **settings})

    def stop(self, name: str) -> None:
        """End a peer's process; the next request starts another."""
        if process := self._running.pop(name, None):
            process.communicate()  # closes its stdin, which ends it

    def _tell(self, name: str, request: dict[str, Any]) -> dict[str, Any]:
        peer = self.table[name]
        if not peer.python.exists():
            return {"failed": f"there is no {peer.python}"}
        process = self._running.get(name) or self._running.setdefault(name, _started(peer))
        if line := _answer(process, json.dumps(request)):
            return json.loads(line)
        if line is None:
            process.kill()
        self.stop(name)
        return {
            "failed": (
                f"no answer within {PATIENCE:.0f} s"
                if line is None
                else f"its process ended with code {process.returncode}"
            )
        }


def _answer(process: subprocess.Popen[str], request: str) -> str | None:
    """The line that a worker answers with; empty where its process has ended, None where patience has."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(request + "\n")
        process.stdin.flush()
    except BrokenPipeError:
        return ""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        return process.stdout.readline() if selector.select(PATIENCE) else None


def _started(peer: Peer) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [str(peer.python), str(HERE / "workers" / peer.worker)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | ONE_THREAD,
    )
