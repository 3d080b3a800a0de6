"""Does what a README shows, with the Python that runs this and none of the source tree: `make release-check`.

Photographs are rendered of the board that the README names; its command and its Python then run beside them
in an empty folder.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SIMULATE = (
    "simulate --lens brown:k1=-0.2 --image-size 640x480 --focal 520 --target chessboard:9x6:25mm --render"
    " -o simulated"
)


def run_readme(readme: Path, folder: Path) -> None:
    """Run a README's command and Python in a folder."""
    text = readme.read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    commands = re.findall(r"^orthoscope (.*)$", text, re.MULTILINE)
    run = [sys.executable, "-m", "orthoscope"]
    subprocess.run([*run, *shlex.split(SIMULATE)], cwd=folder, check=True)
    shutil.move(folder / "simulated" / "photographs", folder / "photos")
    for command in commands:
        subprocess.run([*run, *shlex.split(command)], cwd=folder, check=True)
    subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        run_readme(Path(sys.argv[1]).resolve(), Path(folder))
