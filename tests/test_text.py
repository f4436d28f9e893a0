"""Text of the package in plain technical English: docstrings, retired words, documented arguments and results.

Counts in `REMAINING` are text that is still to be rewritten. They may only fall: lower them together with the text.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "rockerbogie"
#: This file names the retired words.
SKIPPED = {Path(__file__).resolve()}

BANNED_OPENING = re.compile(r"(What|Whether|Where|How|Which|Nothing|None|As|Of)\b")
LONGEST_FIRST_LINE = 90
RETIRED = (
    "nought", "hair", "mend", "mends", "mended", "mending", "overrule", "overrules", "overruled", "hollow", "hollows", "arched",
    "hanging", "hangs", "in the air", "let down", "least place", "hole", "holes", "bend", "bends", "last word", "way down",
    "way out", "roof", "knee", "knees", "the land", "leans", "stance",
)  # fmt: skip
WORD = re.compile(rf"(?<![\w.`\"'])({'|'.join(RETIRED)})(?![\w`\"'(=])", re.IGNORECASE)
#: File and retired word that it may hold: names that are kept for users and stored data.
ALLOWED = {("src/rockerbogie/motion/jacobian.py", "stance"), ("tests/test_golden.py", "holes")}

#: Words that say that an argument is written.
WRITTEN = re.compile(r"\b(filled|written|replaced|overwritten|changed|scratch|work arrays|shifted)\b", re.IGNORECASE)

#: Rule -> folder -> number of places that break it. A folder that is not listed has none.
REMAINING: dict[str, dict[str, int]] = {
    "opening": {},
    "first line": {},
    "retired word": {},
    "Args and Returns": {},
}


class Place(NamedTuple):
    """Place where a rule is broken."""

    file: Path
    line: int
    text: str

    @property
    def folder(self) -> str:
        """Top folder by which `REMAINING` counts."""
        parts = self.file.relative_to(ROOT).parts
        return "/".join(
            parts[:3] if parts[:2] == ("src", "rockerbogie") and len(parts) > 3 else parts[: max(1, min(2, len(parts) - 1))]
        )


def files(*patterns: str) -> list[Path]:
    """Return the text files of the project that match."""
    found = {path for pattern in patterns for path in ROOT.glob(pattern)}
    return sorted(path for path in found if path.resolve() not in SKIPPED and "_build" not in path.parts)


PYTHON = files("src/**/*.py", "tests/**/*.py", "docs/*.py", "examples/*.py", "tools/*.py")
Documented = ast.Module | ast.ClassDef | ast.FunctionDef


def documented(file: Path) -> Iterator[tuple[Documented, str, bool]]:
    """Yield each module, class and function of a file with its docstring, and True if all names on its path are public."""

    def walk(node: Documented, public: bool) -> Iterator[tuple[Documented, str, bool]]:
        yield node, ast.get_docstring(node) or "", public
        for child in node.body:
            if isinstance(child, ast.ClassDef | ast.FunctionDef):
                yield from walk(child, public and not child.name.startswith("_") and not isinstance(node, ast.FunctionDef))

    yield from walk(ast.parse(file.read_text(encoding="utf-8")), True)


@cache
def docstrings() -> list[Place]:
    """Return the place and text of every docstring of the project: parsing all files takes seconds."""
    found = ((file, node, text) for file in PYTHON for node, text, _ in documented(file))
    return [Place(file, getattr(node, "lineno", 1), text) for file, node, text in found if text]


def arguments(node: ast.FunctionDef) -> list[str]:
    """Return the names of a function's arguments, without self and cls."""
    a = node.args
    every = [*a.posonlyargs, *a.args, *([a.vararg] if a.vararg else []), *a.kwonlyargs, *([a.kwarg] if a.kwarg else [])]
    return [arg.arg for arg in every if arg.arg not in ("self", "cls")]


def returns_value(node: ast.FunctionDef) -> bool:
    """Return True if the annotation of the result is not None."""
    return node.returns is not None and ast.unparse(node.returns) not in ("None", "NoReturn")


def is_property(node: ast.FunctionDef) -> bool:
    """Return True for properties, cached ones too."""
    return any("property" in ast.unparse(decorator) for decorator in node.decorator_list)


def openings() -> Iterator[Place]:
    """Yield docstrings that start with a banned word."""
    for place in docstrings():
        if BANNED_OPENING.match(place.text):
            yield Place(place.file, place.line, place.text.splitlines()[0])


def long_first_lines() -> Iterator[Place]:
    """Yield docstrings whose first line is too long, in the package."""
    for place in docstrings():
        if len(place.text.partition("\n")[0]) > LONGEST_FIRST_LINE:
            yield Place(place.file, place.line, place.text.splitlines()[0])


def retired_words() -> Iterator[Place]:
    """Yield lines with a retired word."""
    for file in files("src/**/*.py", "src/**/*.md", "src/**/*.toml", "docs/*.md", "docs/*.py", "README.md", "tests/**/*.py"):
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            found = WORD.search(line)
            if found and (str(file.relative_to(ROOT)), found[1].lower()) not in ALLOWED:
                yield Place(file, number, f"{found[1]!r} in {line.strip()}")


def undocumented() -> Iterator[Place]:
    """Yield public functions and methods of the package without Args or Returns; kernels are another rule."""
    for file in files("src/**/*.py"):
        inside = file.relative_to(PACKAGE).parts
        if inside[0] == "_kernels":
            continue
        for node, text, public in documented(file):
            command = "\nParameters\n----------\n" in text  # of the command line, whose result is an exit code
            if not public or command or not isinstance(node, ast.FunctionDef) or is_property(node):
                continue
            missing = [
                section
                for section, needed in (("Args", arguments(node)), ("Returns", returns_value(node)))
                if needed and f"\n{section}:\n" not in text and not (section == "Returns" and "\nYields:\n" in text)
            ]
            if missing:
                yield Place(file, node.lineno, f"{node.name} has no {' and no '.join(missing)}")


def undocumented_kernels() -> Iterator[Place]:
    """Yield kernel functions with arguments and without Args."""
    for file in files("src/rockerbogie/_kernels/**/*.py"):
        for node, text, _ in documented(file):
            operator = isinstance(node, ast.FunctionDef) and node.name.startswith("__")  # its operands are Python's
            if isinstance(node, ast.FunctionDef) and not operator and arguments(node) and "\nArgs:\n" not in text:
                yield Place(file, node.lineno, f"{node.name} has no Args")


def written(node: ast.FunctionDef) -> set[str]:
    """Return the arguments of a function whose elements or fields it assigns to."""
    names, rebound = set(), set()
    for part in ast.walk(node):
        targets = part.targets if isinstance(part, ast.Assign) else [part.target] if isinstance(part, ast.AugAssign) else []
        for target in targets:
            for one in target.elts if isinstance(target, ast.Tuple | ast.List) else [target]:
                base: ast.AST = one
                while isinstance(base, ast.Subscript | ast.Attribute):
                    base = base.value
                if isinstance(base, ast.Name):
                    (rebound if base is one else names).add(base.id)
    return (names - rebound) & set(arguments(node))


def unnamed_writes() -> Iterator[Place]:
    """Yield kernels that write to an argument whose entry under Args does not say so."""
    for file in files("src/rockerbogie/_kernels/**/*.py"):
        for node, text, _ in documented(file):
            if isinstance(node, ast.FunctionDef) and "\nArgs:\n" in text and "\nWrites:" not in text:
                section = text.partition("\nArgs:\n")[2].partition("\n\n")[0]
                entries = re.findall(r"^    ([\w, *]+): ((?:.|\n(?!    \w))*)", section, re.MULTILINE)
                said = {name.strip(): entry for names, entry in entries for name in names.split(",")}
                for name in sorted(written(node)):
                    if not WRITTEN.search(said.get(name, "")):
                        yield Place(file, node.lineno, f"{node.name} writes to {name}: {said.get(name, '')[:60]}")


def without_docstring() -> Iterator[Place]:
    """Yield functions and methods of the package that have no docstring.

    Operators need none, nor do the bodiless functions of a protocol, whose field names say it.
    """
    for file in files("src/rockerbogie/**/*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        for owner in ast.walk(tree):
            for node in owner.body if isinstance(owner, ast.Module | ast.ClassDef) else []:
                function = isinstance(node, ast.FunctionDef) and not node.name.startswith("__")
                if function and not ast.get_docstring(node) and ast.unparse(node.body[-1]) != "...":
                    yield Place(file, node.lineno, f"{node.name} has no docstring")


RULES = {
    "docstring": without_docstring,
    "opening": openings,
    "first line": long_first_lines,
    "retired word": retired_words,
    "Args and Returns": undocumented,
    "kernel Args": undocumented_kernels,
    "written arguments": unnamed_writes,
}


@pytest.mark.parametrize("rule", RULES)
def test_text_follows_the_rule(rule: str) -> None:
    places = list(RULES[rule]())
    counts = Counter(place.folder for place in places)
    allowed = REMAINING.get(rule, {})
    over = {folder: count for folder, count in counts.items() if count > allowed.get(folder, 0)}
    lines = [f"{p.file.relative_to(ROOT)}:{p.line}: {p.text[:110]}" for p in places if p.folder in over]
    assert not over, f"{rule}: {over}, allowed {allowed}\n" + "\n".join(lines)


def test_the_rules_find_what_they_forbid(tmp_path: Path) -> None:
    assert BANNED_OPENING.match("Whether it touches.")
    assert not BANNED_OPENING.match("Assert something.")
    assert WORD.search("the wheel hangs there")
    assert WORD.search("Six wheels, let down slowly")
    assert not WORD.search("a wholesale chair; `hole` in code; legend")
    sample = tmp_path / "sample.py"
    sample.write_text('def f(a: int) -> int:\n    """Return a."""\n\n\ndef _g():\n    """Do it."""\n', encoding="utf-8")
    found = list(documented(sample))
    assert [public for _, _, public in found] == [True, True, False]
    assert arguments(found[1][0]) == ["a"]  # type: ignore[arg-type]
    assert returns_value(found[1][0])  # type: ignore[arg-type]
    sample.write_text("def f(a, b, c):\n    a[0], d = 1, 2\n    b.x += 1\n    c = a\n    c[0] = 1\n", encoding="utf-8")
    assert written(list(documented(sample))[1][0]) == {"a", "b"}  # type: ignore[arg-type]


if __name__ == "__main__":  # prints the counts for REMAINING, and with a rule and folders the places in them
    import sys

    for name, find in RULES.items():
        print(f'    "{name}": {dict(sorted(Counter(place.folder for place in find()).items()))},')
    for place in RULES[sys.argv[1]]() if len(sys.argv) > 1 else ():
        if place.folder in sys.argv[2:]:
            print(f"{place.file.relative_to(ROOT)}:{place.line}: {place.text}")
