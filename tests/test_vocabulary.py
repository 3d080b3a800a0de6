"""One word a thing: public names have one meaning, docstrings name what is there, constants say it whole."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from itertools import takewhile
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "src" / "orthoscope"

Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef

# The headings of a docstring, in their order.
SECTIONS = ("Args", "Attributes", "Returns", "Raises", "Source")


parsed = cache(ast.parse)


def modules(package: Path) -> dict[Path, ast.Module]:
    """The parsed files of a package, by their paths in it."""
    return {path.relative_to(package): parsed(path.read_text()) for path in sorted(package.rglob("*.py"))}


def listed(module: ast.Module) -> set[str]:
    """The names in a module's __all__."""
    return {
        entry.value
        for node in module.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        for entry in ast.walk(node.value)
        if isinstance(entry, ast.Constant)
    }


def is_verb(path: Path, node: Definition) -> bool:
    """Whether this is a verb of the command line, which bears the name of the function that it calls."""
    return path.parts[0] == "cli" and any("click.command(" in ast.unparse(one) for one in node.decorator_list)


def names_with_two_meanings(package: Path) -> dict[str, list[str]]:
    """Public classes and functions that are defined in more than one module, with these modules."""
    places: dict[str, list[str]] = defaultdict(list)
    for path, module in modules(package).items():
        public = listed(module)
        for node in module.body:
            if isinstance(node, Definition) and node.name in public and not is_verb(path, node):
                places[node.name].append(str(path))
    return {name: where for name, where in places.items() if len(set(where)) > 1}  # overloads are one


def definitions(module: ast.Module) -> Iterator[Definition]:
    """All classes and functions of a module, inner ones too."""
    return (node for node in ast.walk(module) if isinstance(node, Definition))


def documented(docstring: str, section: str) -> list[str]:
    """The names that a section of a docstring explains, `left, top: ...` being two."""
    found = re.search(rf"^{section}:\n((?:    .*(?:\n|$))+)", docstring, re.MULTILINE)
    lines = re.findall(r"^    ([\w*]+(?:, [\w*]+)*): ", found.group(1), re.MULTILINE) if found else []
    return [name.strip("*") for line in lines for name in line.split(", ")]


def there(node: Definition) -> set[str]:
    """The parameters of a function; the fields and properties of a class, and what it is made from."""
    if not isinstance(node, ast.ClassDef):
        arguments = node.args
        every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
        return {one.arg for one in (*every, arguments.vararg, arguments.kwarg) if one}
    names: set[str] = set()
    for one in ast.walk(node):
        match one:
            case ast.AnnAssign(target=ast.Name(id=name)) | ast.Assign(targets=[ast.Name(id=name)]):
                names.add(name)
            case ast.FunctionDef(name="__init__"):
                names |= there(one)
            case ast.Attribute(value=ast.Name(id="self"), attr=name):
                names.add(name)
    return names


def faults_of(docstring: str, node: Definition) -> list[str]:
    """What is wrong with a docstring's form."""
    faults = [
        f"{name} is explained and not there"
        for section in ("Args", "Attributes")
        for name in documented(docstring, section)
        if name not in there(node)
    ]
    headings = [one for one in re.findall(r"^(\w+):$", docstring, re.MULTILINE) if one in SECTIONS]
    if headings != sorted(headings, key=SECTIONS.index):
        faults.append(f"the sections stand as {', '.join(headings)}")
    return faults


def half_said(source: str) -> list[str]:
    """Constants of a module whose comment is no whole sentence of its own in the lines above, with these."""
    lines = source.splitlines()
    found = []
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
        names = [one.id for one in ast.walk(target) if isinstance(one, ast.Name)]
        if not all(name.isupper() for name in names):
            continue
        first = node.lineno - 1
        above = list(takewhile(lambda line: line.startswith("# "), reversed(lines[:first])))
        said = " ".join(line[2:] for line in reversed(above))
        behind = re.search(r"  # (?!fmt|noqa|pyright|type)", lines[first])
        if behind or (said and (said[0].islower() or said[-1] not in ".:)")):
            found.append(f"{', '.join(names)}: {said or lines[first]}")
    return found


def test_the_comment_of_a_constant_is_a_sentence_of_its_own():
    found = [
        f"{path}: {one}" for path in sorted(PACKAGE.rglob("*.py")) for one in half_said(path.read_text())
    ]
    assert found == []


@pytest.mark.parametrize(
    "comment",
    ["STEPS = 3  # of each stage", "# of each stage, at most\nSTEPS = 3", "# Each has so many,\nSTEPS = 3"],
)
def test_half_a_sentence_at_a_constant_is_seen(comment):
    assert len(half_said(comment)) == 1
    assert half_said("# Each stage has at most so many steps.\nSTEPS = 3") == []


def test_no_public_name_is_defined_twice():
    assert names_with_two_meanings(PACKAGE) == {}


def test_every_file_says_what_it_is():
    silent = [str(path) for path, module in modules(PACKAGE).items() if not ast.get_docstring(module)]
    assert silent == []


def test_docstrings_explain_parameters_that_are_there_in_sections_that_stand_in_order():
    faults = [
        f"{path}: {node.name}: {fault}"
        for path, module in modules(PACKAGE).items()
        for node in definitions(module)
        for fault in faults_of(ast.get_docstring(node) or "", node)
    ]
    assert faults == []


def test_a_name_that_is_defined_twice_is_seen_and_a_verb_may_have_it(tmp_path):
    for name in ("lens/fit.py", "pose/fit.py"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text('__all__ = ["fit"]\n\n\ndef fit():\n    pass\n')
    assert names_with_two_meanings(tmp_path) == {"fit": ["lens/fit.py", "pose/fit.py"]}
    (tmp_path / "pose").rename(tmp_path / "cli")
    assert "fit" in names_with_two_meanings(tmp_path)
    verb = '__all__ = ["fit"]\n\n\n@click.command(epilog="")\ndef fit():\n    pass\n'
    (tmp_path / "cli/fit.py").write_text(verb)
    assert names_with_two_meanings(tmp_path) == {}


@pytest.mark.parametrize(
    ("docstring", "fault"),
    [
        ("A sum.\n\nArgs:\n    left, top: of it.\n    bottom: of it.", "bottom is explained and not there"),
        (
            "A sum.\n\nRaises:\n    InputError: no.\nArgs:\n    left: of it.",
            "the sections stand as Raises, Args",
        ),
    ],
)
def test_a_docstring_that_is_not_in_the_form_is_seen(docstring, fault):
    (node,) = ast.parse("def total(left, top):\n    pass").body
    assert isinstance(node, ast.FunctionDef)
    assert faults_of(docstring, node) == [fault]
