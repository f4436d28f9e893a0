"""Kernels without reference counts: they neither make arrays nor take any from a call."""

from __future__ import annotations

import ast
from pathlib import Path

import rockerbogie

ROOT = Path(rockerbogie.__file__).parent
FILES = (*sorted((ROOT / "_kernels").rglob("*.py")), ROOT / "figures" / "raster_kernels.py")
OWNING, BORROWING = {"owning_njit", "owning_fma_njit"}, {"njit", "fma_njit", "force_inlined"}


def kernels() -> list[tuple[Path, ast.FunctionDef, set[str]]]:
    """Return all kernels with the names of their decorators."""
    found = []
    for file in FILES:
        for item in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(item, ast.FunctionDef):
                names = {ast.unparse(decorator) for decorator in item.decorator_list}
                if names & (OWNING | BORROWING):
                    found.append((file, item, names))
    return found


def records() -> dict[str, set[str]]:
    """Return the types in all NamedTuples and type aliases of kernels."""
    found: dict[str, set[str]] = {}
    for file in FILES:
        for item in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(item, ast.ClassDef):
                fields = [field.annotation for field in item.body if isinstance(field, ast.AnnAssign)]
                found[item.name] = set().union(*map(names_in, fields))
            elif isinstance(item, ast.Assign) and isinstance(item.value, ast.Subscript) and isinstance(item.targets[0], ast.Name):
                found[item.targets[0].id] = names_in(item.value)
    return found


def names_in(item: ast.expr | None) -> set[str]:
    """Return the names in an annotation."""
    return {node.id for node in ast.walk(item) if isinstance(node, ast.Name)} if item is not None else set()


def returns_arrays(item: ast.FunctionDef, known: dict[str, set[str]]) -> bool:
    """Return True if a kernel returns more than numbers and records of numbers."""
    names = names_in(item.returns)
    while names & known.keys():
        names = (names - known.keys()).union(*(known[name] for name in names & known.keys()))
    return not names <= {"tuple", "int", "float", "bool"}


def test_kernel_that_counts_no_references_returns_no_array() -> None:
    """The caller would free an array that it does not own."""
    known = records()
    wrong = [f"{file.name}: {item.name}" for file, item, names in kernels() if names & BORROWING and returns_arrays(item, known)]
    assert wrong == []


def test_kernel_that_takes_an_array_from_a_call_counts_references() -> None:
    """Without counts, the caller would never free the array that it is given."""
    known = records()
    makers = {item.name for _, item, names in kernels() if names & OWNING and returns_arrays(item, known)}
    assert {"new_mechanism", "bridged_grid", "lay_out"} <= makers
    wrong = [
        f"{file.name}: {item.name} calls {call.func.id}"
        for file, item, names in kernels()
        if names & BORROWING
        for call in ast.walk(item)
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in makers
    ]
    assert wrong == []
