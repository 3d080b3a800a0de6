"""The syntaxes that tools write cameras in, read into plain values: dict, list, str, and numbers where JSON
has them.

Nothing here trusts the file: depth and size are bounded, nothing is executed, no entity is expanded, and
whatever is wrong ends in an `InputError` that names the file. YAML goes by its events, so that no depth of
nesting reaches the stack; its scalars stay text, which `number` turns into numbers, since 1e-05 is a number
to one YAML reader and a word to the next. Tags such as OpenCV's `!!opencv-matrix` say nothing that the keys
do not, and are passed over.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orthoscope.files.whole_files import read_bytes
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.models.camera import LARGEST_SIDE

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

__all__ = ["Document", "json_number", "matrix", "number", "numbers", "whole_number", "yaml_list"]

# A camera's file is a few kB; OpenCV's may hold all corners too.
LARGEST_FILE = 64 * 1024 * 1024
# Brackets within brackets; tools use three or four.
DEEPEST = 40
# Squares and products of what is read must be numbers too.
LARGEST_NUMBER = 1e100
# The longest word that an error repeats.
LONGEST_SHOWN = 40


class Document:
    """A file that is to be read: its bytes, and what they are in each syntax (None where they are not of
    it).
    """

    def __init__(self, path: str | Path, content: bytes | None = None) -> None:
        self.path = Path(path)
        self.content = read_bytes(path) if content is None else content

    @cached_property
    def text(self) -> str | None:
        """The file as text (UTF-8)."""
        if self._is_too_large:
            return None
        try:
            return self.content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
        except UnicodeDecodeError:
            return None

    @cached_property
    def json(self) -> Any:
        """The file's JSON value."""
        import msgspec

        if self._is_too_large or self.content.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] not in (b"{", b"["):
            return None
        try:
            return msgspec.json.decode(self.content.removeprefix(b"\xef\xbb\xbf"))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return None

    @cached_property
    def yaml(self) -> Any:
        """The file's first YAML document, its scalars as text."""
        text = self.text
        if text is None or text.lstrip()[:1] in ("", "<") or "\0" in text:
            return None
        return _yaml(re.sub(r"\A%YAML:1\.0[^\n]*\n", "", text))

    @cached_property
    def xml(self) -> Element | None:
        """The root of the file's XML; entities of its own are refused."""
        from xml.etree import ElementTree

        if self._is_too_large or b"<" not in self.content[:512] or b"<!ENTITY" in self.content:
            return None
        try:
            return ElementTree.fromstring(self.content)
        except (ElementTree.ParseError, ValueError, LookupError, RecursionError):
            return None

    @cached_property
    def python(self) -> Any:
        """The file's value in Python's notation, comments passed over; only literals."""
        text = self.text
        if text is None or _depth(text) > DEEPEST:
            return None
        try:
            return ast.literal_eval(text.strip())
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            return None

    @property
    def table(self) -> dict[str, Any]:
        """The file's object, of JSON or YAML; empty where it is none."""
        value = self.json if self.json is not None else self.yaml
        return value if isinstance(value, dict) else {}

    @property
    def _is_too_large(self) -> bool:
        return len(self.content) > LARGEST_FILE

    def refuse(self, got: str, do: str = "Write the file again with its tool.") -> InputError:
        """The error for this file: what is wrong with it, what to do."""
        return InputError(f"{self.path} {got}. {do}")


def number(value: Any, what: str, document: Document) -> float:
    """A finite number, also where it was written as text.

    Raises:
        InputError: it is none.
    """
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        try:
            converted = float("nan") if isinstance(value, str) and "_" in value else float(value)
        except (ValueError, OverflowError):
            converted = float("nan")
        if abs(converted) <= LARGEST_NUMBER:  # which NaN is not
            return converted
    raise document.refuse(f"has {_shown(value)} as {what}; expected a number, at most {LARGEST_NUMBER:g}")


def whole_number(value: Any, what: str, document: Document) -> int:
    """A side of an image, a count: a whole number from 1 to a million.

    Raises:
        InputError: it is none.
    """
    converted = number(value, what, document)
    if converted != int(converted) or not 1 <= converted <= LARGEST_SIDE:
        raise document.refuse(
            f"has {_shown(value)} as {what}; expected a whole number from 1 to {LARGEST_SIDE}"
        )
    return int(converted)


def numbers(values: Any, what: str, document: Document, *, count: int | None = None) -> list[float]:
    """Finite numbers: a list, lists in it, or text with blanks or commas between.

    Args:
        count: how many there must be.
    Raises:
        InputError: one is none, or there are more or fewer.
    """
    if isinstance(values, str):
        values = values.replace(",", " ").split()
    if not isinstance(values, list | tuple):
        raise document.refuse(f"has {_shown(values)} as {what}; expected a list of numbers")
    flat: list[Any] = []
    for value in values:
        flat.extend(value if isinstance(value, list | tuple) else [value])
    if count is not None and len(flat) != count:
        raise document.refuse(f"has {len(flat)} numbers as {what}; expected {count}")
    return [number(value, what, document) for value in flat]


def matrix(node: Any, what: str, document: Document) -> ndarray:
    """A matrix: rows, cols and data (OpenCV, ROS), or rows in a list.

    Raises:
        InputError: it is none, or has not as many numbers as it says.
    """
    if isinstance(node, dict):
        if "data" not in node:
            raise document.refuse(f"has no data in {what}; expected rows, cols and data")
        values = numbers(node["data"], what, document)
        rows, columns = (
            whole_number(node.get(key, default), f"{key} of {what}", document) if values else 0
            for key, default in (("rows", 1), ("cols", len(values)))
        )
    else:
        values = numbers(node, what, document)
        rows = len(node) if isinstance(node, list) and node and isinstance(node[0], list) else 1
        columns = len(values) // max(rows, 1)
    if rows * columns != len(values):
        raise document.refuse(f"has {len(values)} numbers in {what}; expected {rows} by {columns}")
    return np.array(values).reshape(rows, columns)


def yaml_list(values: Iterable[float] | ndarray) -> str:
    """A YAML list; each number with a point and the digits that read back as the same."""
    return "[" + ", ".join(yaml_number(value) for value in np.ravel(np.array(list(values))).tolist()) + "]"


def yaml_number(value: float) -> str:
    """A number that YAML 1.1 takes for one: to it 1e-05 is a word, 1.0e-05 a number."""
    text = repr(float(value))
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def json_number(value: float) -> float:
    """A plain Python number, as JSON wants it."""
    return float(value)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def _depth(text: str) -> int:
    """The deepest nesting of brackets, not looking at quotes."""
    steps = np.zeros(len(text) + 1, dtype=np.int64)
    codes = np.frombuffer(text.encode("utf-32-le"), dtype=np.uint32)
    steps[1:][np.isin(codes, [ord(c) for c in "[({"])] = 1
    steps[1:][np.isin(codes, [ord(c) for c in "])}"])] = -1
    return int(np.cumsum(steps).max())


def _yaml(text: str) -> Any:
    """The value of a YAML text from its events; None where it is none, is too deep or names a key twice."""
    import yaml

    anchors: dict[str, Any] = {}
    open_nodes: list[tuple[list[Any], bool, str | None]] = [([], False, None)]
    try:
        for event in yaml.parse(text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader)):
            if isinstance(event, yaml.DocumentEndEvent):
                break
            if isinstance(event, yaml.ScalarEvent):
                value: Any = event.value
                anchor = event.anchor
            elif isinstance(event, yaml.AliasEvent):
                value, anchor = anchors[event.anchor], None
            elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
                if len(open_nodes) > DEEPEST:
                    return None
                open_nodes.append(([], isinstance(event, yaml.MappingStartEvent), event.anchor))
                continue
            elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
                entries, keyed, anchor = open_nodes.pop()
                value = dict(zip(entries[::2], entries[1::2], strict=True)) if keyed else entries
                if keyed and len(value) != len(entries) // 2:
                    return None
            else:
                continue
            if anchor:
                anchors[anchor] = value
            open_nodes[-1][0].append(value)
    except (yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError):
        return None
    return open_nodes[0][0][0] if open_nodes[0][0] else None
