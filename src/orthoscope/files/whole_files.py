"""Files as wholes: read at once, or written at once and never half.

What is written goes to a temporary file beside its place, which then takes the place in one step; whatever
happens before that (a full disk, Ctrl-C) leaves the place as it was. Folders are made as needed.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from orthoscope.geometry.arrays import InputError

# Bytes of a file's name; no usual file system takes more.
LONGEST_NAME = 255

__all__ = [
    "check_folder",
    "check_not_onto",
    "keep_inputs",
    "read_bytes",
    "read_text",
    "write_bytes",
    "write_text",
]

# Files that are being read: device and number of each. `write_bytes` replaces none of them.
_INPUTS: set[tuple[int, int]] = set()


def read_bytes(path: str | Path) -> bytes:
    """All of a file.

    Raises:
        InputError: there is none, or it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist; expected a file. Check the name and the folder.") from error
    except (OSError, ValueError) as error:
        raise InputError(
            f"{_shown(path)} cannot be read ({_reason(error)}); expected a file that you may read."
        ) from error


def read_text(path: str | Path) -> str:
    """All of a text file (UTF-8, any line ends), lines ending in a line feed.

    Raises:
        InputError: it cannot be read, or is no text.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not text (byte {error.start} is no UTF-8); expected a text file."
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def write_text(path: str | Path, text: str) -> None:
    """Replaces a file as a whole by this text (UTF-8); see `write_bytes`."""
    write_bytes(path, text.encode())


def write_bytes(path: str | Path, content: bytes) -> None:
    """Replaces a file as a whole; its folder is made where it is missing, a link stays a link.

    Raises:
        InputError: the place cannot be written.
    """
    try:
        place = Path(os.path.realpath(path))
        if _identity(place) in _INPUTS and place.read_bytes() != content:
            raise InputError(_onto(path))
        if place.is_dir():
            raise InputError(f"{path} is a folder; expected the name of a file to write.")
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.exists() and not place.is_file():  # a device or a pipe: there is nothing to replace
            place.write_bytes(content)
        else:
            _replace(place, content)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{_shown(path)} cannot be written ({_reason(error)}); choose another place or free this one."
        ) from error


def check_folder(folder: str | Path) -> None:
    """Says before a long job that its folder could not be written; makes nothing.

    Raises:
        InputError: the folder, or the nearest one above it that exists, is a file or may not be written.
    """
    place = Path(folder).absolute()
    if "\0" in str(folder):
        raise InputError(f"{_shown(folder)} cannot be written (a name with a NUL); choose another place.")
    try:
        while not place.exists():
            place = place.parent
    except (OSError, ValueError) as error:
        raise InputError(
            f"{_shown(folder)} cannot be written ({_reason(error)}); choose another place."
        ) from error
    longest = max(map(len, (os.fsencode(part) for part in Path(folder).parts)), default=0)
    if longest > LONGEST_NAME:
        raise InputError(
            f"{_shown(folder)} cannot be written (a name of {longest} bytes); expected at most"
            f" {LONGEST_NAME}."
        )
    if not place.is_dir():
        raise InputError(f"{place} is a file; expected a folder to write into. Choose another place.")
    if not os.access(place, os.W_OK | os.X_OK):
        raise InputError(f"{place} may not be written; choose another place or change its permissions.")


@contextmanager
def keep_inputs(paths: Iterable[str | Path]) -> Iterator[None]:
    """Within this block `write_bytes` replaces none of these files, by any name, unless by the same bytes.

    The command line says this of all that it is given to read; a program that saves what it has loaded is
    free to.
    """
    before = set(_INPUTS)
    _INPUTS.update(identity for path in paths if (identity := _identity(Path(path))))
    try:
        yield
    finally:
        _INPUTS.clear()
        _INPUTS.update(before)


def check_not_onto(places: Iterable[str | Path], inputs: Iterable[str | Path]) -> None:
    """Says before a job that one of its outputs is one of its inputs, by whatever name.

    Args:
        places: the outputs.
        inputs: the files that are read.
    Raises:
        InputError: one is; it is named.
    """
    known = {identity for path in inputs if (identity := _identity(Path(path)))}
    for place in places:
        if _identity(Path(place)) in known:
            raise InputError(_onto(place))


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and number of a file that exists."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return (found.st_dev, found.st_ino) if path.is_file() else None


def _onto(path: str | Path) -> str:
    return (
        f"{path} is one of the files that are read; what is read is never written onto. Choose another place."
    )


def _replace(place: Path, content: bytes) -> None:
    temporary = place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, place)
    except BaseException:  # Ctrl-C too leaves nothing behind
        temporary.unlink(missing_ok=True)
        raise


def _shown(path: str | Path) -> str:
    """A path for a message, cut where it is very long."""
    text = str(path).replace("\0", "\\0")
    return text if len(text) <= LONGEST_NAME else text[:60] + "..."


def _reason(error: Exception) -> str:
    if not isinstance(error, OSError):
        return str(error)
    at = (
        f": {error.filename}"
        if isinstance(error, NotADirectoryError | FileExistsError) and error.filename
        else ""
    )
    return f"{error.strerror or error}{at}"
