"""`orthoscope`, and `python -m orthoscope`: the command line, which may be stopped while it loads, too."""

from __future__ import annotations

import sys

__all__ = ["start"]


def start() -> None:
    """Run the command line."""
    try:
        from orthoscope.cli import main
    except KeyboardInterrupt:
        sys.exit(130)
    main()


if __name__ == "__main__":
    start()
