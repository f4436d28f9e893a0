"""Rows of the lane array that each SIMD kernel reads and writes, found in its source."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from rockerbogie._kernels.simd import layout

GROUPS = {name: group for name, group in vars(layout).items() if hasattr(group, "_fields") and isinstance(group, tuple)}
ALL_ROWS = [f"{name}.{field}" for name, group in GROUPS.items() for field in group._fields]
#: Intrinsics: positions of the rows they read, and the rows they write.
INTRINSICS = {
    "take_corners": ((1, 2), {"CELL.h00", "CELL.h01", "CELL.h10", "CELL.h11"}),
    "take_patch": ((1, 2), {"CUBIC.coef"}),
}


class Access(NamedTuple):
    """Rows, and row arguments by their names, that a function reads and writes."""

    reads: set[str]
    writes: set[str]


def kernels(folder: Path = Path(layout.__file__).parent) -> dict[str, ast.FunctionDef]:
    """Return the functions of the SIMD modules that take the lane array, by "module.name"."""
    found = {}
    for file in sorted(folder.glob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and any(arg.arg == "lanes" for arg in node.args.args):
                found[f"{file.stem}.{node.name}"] = node
    return found


def accesses(functions: dict[str, ast.FunctionDef]) -> dict[str, Access]:
    """Return the rows that each function and its callees read and write."""
    done: dict[str, Access] = {}
    for name in functions:
        _access(name, functions, done)
    return done


def _access(name: str, functions: dict[str, ast.FunctionDef], done: dict[str, Access]) -> Access:
    if name in done:
        return done[name]
    node, module = functions[name], name.split(".")[0]
    numbers = {"lanes", "i", "l", "side", "columns", "lines", "count", "few", "part", "rounds", "wheels"}
    parameters = {arg.arg for arg in node.args.args} - numbers
    aliases: dict[str, set[str]] = {}
    result = done[name] = Access(set(), set())

    def rows(expression: ast.AST) -> set[str]:
        match expression:
            case ast.Attribute(value=ast.Name(id=group), attr=field) if group in GROUPS:
                return {f"{group}.{field}"}
            case ast.Name(id=variable):
                return aliases.get(variable, {variable} & parameters)
            case ast.Subscript() | ast.Call(func=ast.Name(id="float" | "_lower")):
                return set()
        return set().union(*(rows(child) for child in ast.iter_child_nodes(expression)))

    def note(target: ast.AST, value: ast.AST) -> None:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for one, other in zip(target.elts, value.elts, strict=True):
                note(one, other)
        elif isinstance(target, ast.Name):
            found = {row for row in rows(value) if "." in row or row in parameters}
            if found:
                aliases[target.id] = aliases.get(target.id, set()) | found

    def is_lanes(part: ast.AST) -> bool:
        return isinstance(part, ast.Subscript) and isinstance(part.value, ast.Name) and part.value.id == "lanes"

    for part in ast.walk(node):
        if isinstance(part, ast.Assign):
            for target in part.targets:
                note(target, part.value)
        if isinstance(part, ast.For) and isinstance(part.iter, ast.Tuple):
            for value in part.iter.elts:
                note(part.target, value)
    for part in ast.walk(node):
        if is_lanes(part):
            (result.writes if isinstance(part.ctx, ast.Store) else result.reads).update(rows(part.slice))
        if isinstance(part, ast.AugAssign) and is_lanes(part.target):
            result.reads.update(rows(part.target.slice))
        if isinstance(part, ast.Call):
            called = part.func.attr if isinstance(part.func, ast.Attribute) else getattr(part.func, "id", "")
            if called in INTRINSICS:
                positions, written = INTRINSICS[called]
                result.reads.update(*(rows(part.args[n]) for n in positions))
                result.writes.update(written)
            owner = (
                part.func.value.id if isinstance(part.func, ast.Attribute) and isinstance(part.func.value, ast.Name) else module
            )
            for full in _candidates(called, owner, functions):
                callee = _access(full, functions, done)
                given = dict(zip((arg.arg for arg in functions[full].args.args), part.args, strict=False))
                for mine, theirs in zip(result, callee, strict=True):
                    for row in theirs:
                        mine.update({row} if "." in row else rows(given[row]))
    for rows_of in result:  # numbers that are part of an index and no row
        rows_of -= {row for row in rows_of if "." not in row and not _is_row_argument(node, row)}
    return result


def _candidates(called: str, owner: str, functions: dict[str, ast.FunctionDef]) -> Iterable[str]:
    if f"{owner}.{called}" in functions:
        return [f"{owner}.{called}"]
    return [full for full in functions if full.split(".")[1] == called][:1]


def _is_row_argument(node: ast.FunctionDef, name: str) -> bool:
    return any(arg.arg == name and isinstance(arg.annotation, ast.Name) and arg.annotation.id == "int" for arg in node.args.args)


def describe(rows: set[str]) -> str:
    """Return rows in the order of the layout; a group whose rows all occur is "GROUP (all)"."""
    words = sorted(row for row in rows if "." not in row)
    for name, group in GROUPS.items():
        found = [f"{name}.{field}" for field in group._fields if f"{name}.{field}" in rows]
        words += [f"{name} (all)"] if len(found) == len(group) > 1 else found
    return ", ".join(words) or "none"
