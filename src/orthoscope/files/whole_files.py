"""Files as wholes: read at once, or written at once and never half.

What is written goes to a temporary file beside its place, which then takes the place in one step; whatever
happens before that (a full disk, Ctrl-C) leaves the place as it was. Folders are made as needed.
"""

from __future__ import annotations

import os
from pathlib import Path

from orthoscope.geometry.arrays import InputError

__all__ = ["check_folder", "read_bytes", "read_text", "write_bytes", "write_text"]


def read_bytes(path: str | Path) -> bytes:
    """All of a file.

    Raises InputError where there is none or it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist; expected a file. Check the name and the folder.") from error
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({_reason(error)}); expected a file that you may read."
        ) from error


def read_text(path: str | Path) -> str:
    """All of a text file (UTF-8, any line ends), lines ending in a line feed.

    Raises InputError where it cannot be read or is no text.
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

    Raises InputError where the place cannot be written.
    """
    place = Path(os.path.realpath(path))
    try:
        if place.is_dir():
            raise InputError(f"{path} is a folder; expected the name of a file to write.")
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.exists() and not place.is_file():  # a device or a pipe: there is nothing to replace
            place.write_bytes(content)
        else:
            _replace(place, content)
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({_reason(error)}); choose another place or free this one."
        ) from error


def check_folder(folder: str | Path) -> None:
    """Says before a long job that its folder could not be written; makes nothing.

    Raises InputError where the folder, or the nearest one above it that exists, is a file or may not be
    written.
    """
    place = Path(folder).absolute()
    while not place.exists():
        place = place.parent
    if not place.is_dir():
        raise InputError(f"{place} is a file; expected a folder to write into. Choose another place.")
    if not os.access(place, os.W_OK | os.X_OK):
        raise InputError(f"{place} may not be written; choose another place or change its permissions.")


def _replace(place: Path, content: bytes) -> None:
    temporary = place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, place)
    except BaseException:  # Ctrl-C too leaves nothing behind
        temporary.unlink(missing_ok=True)
        raise


def _reason(error: OSError) -> str:
    at = (
        f": {error.filename}"
        if isinstance(error, NotADirectoryError | FileExistsError) and error.filename
        else ""
    )
    return f"{error.strerror or error}{at}"
