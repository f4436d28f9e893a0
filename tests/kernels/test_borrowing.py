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


def returns_arrays(item: ast.FunctionDef) -> bool:
    """Return True if a kernel returns more than numbers."""
    names = {node.id for node in ast.walk(item.returns) if isinstance(node, ast.Name)} if item.returns is not None else set()
    return not names <= {"tuple", "int", "float", "bool"}


def test_kernel_that_takes_an_array_from_a_call_counts_references() -> None:
    """Without counts, the caller would never free the array that it is given."""
    makers = {item.name for _, item, names in kernels() if names & OWNING and returns_arrays(item)}
    assert {"new_mechanism", "bridged_grid", "lay_out"} <= makers
    wrong = [
        f"{file.name}: {item.name} calls {call.func.id}"
        for file, item, names in kernels()
        if names & BORROWING
        for call in ast.walk(item)
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in makers
    ]
    assert wrong == []
