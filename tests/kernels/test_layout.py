"""Layout of the lane array: rows do not overlap, and functions state what they access."""

from __future__ import annotations

import ast
import re
import textwrap
from itertools import pairwise

import pytest

from rockerbogie._kernels.simd import layout
from support.lane_access import GROUPS, INTRINSICS, accesses, describe, kernels

COMMON = ("POSE", "WHEEL", "CONTACT")
SOLVERS = {"cubic": ("CUBIC",), "bilinear": tuple(name for name in GROUPS if name not in (*COMMON, "CUBIC"))}
FUNCTIONS = kernels()
ACCESSES = accesses(FUNCTIONS)


def stated(doc: str, label: str) -> str:
    """Return the rows that a docstring states after "Reads:" or "Writes:", on one line."""
    found = re.search(rf"^{label}: +(.*(?:\n    +\S.*)*)", textwrap.dedent(doc), re.MULTILINE)
    assert found is not None, f"no {label}:"
    return " ".join(found[1].split())


@pytest.mark.parametrize("solver", SOLVERS)
def test_rows_follow_one_another(solver: str) -> None:
    rows = [
        (start, size)
        for name in (*COMMON, *SOLVERS[solver])
        for start, size in zip(GROUPS[name], type(GROUPS[name])._field_defaults.values(), strict=True)
    ]
    assert rows[0][0] == layout.LINE > layout.WIDTH
    assert all(one[0] + one[1] == other[0] for one, other in pairwise(rows))
    assert sum(rows[-1]) == getattr(layout, f"{solver.upper()}_SIZE")
    assert all(size % layout.LANES == 0 for _, size in rows)


def test_every_row_is_written_and_read() -> None:
    """Only the rows of results are read elsewhere, in `batch`."""
    rows = {f"{name}.{field}" for name, group in GROUPS.items() for field in group._fields}
    written = set().union(*(access.writes for access in ACCESSES.values()))
    read = set().union(*(access.reads for access in ACCESSES.values()))
    assert rows - written == set()
    assert rows - read <= {"CUBIC.verdict", "BILINEAR.fate"}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_function_states_the_rows_it_reads_and_writes(name: str) -> None:
    doc = ast.get_docstring(FUNCTIONS[name], clean=True) or ""
    assert stated(doc, "Reads") == describe(ACCESSES[name].reads)
    assert stated(doc, "Writes") == describe(ACCESSES[name].writes)


def test_intrinsics_copy_into_rows_that_follow_one_another() -> None:
    corners = sorted(INTRINSICS["take_corners"][1])
    cell = layout.CELL
    assert [layout.CELL[cell._fields.index(row.split(".")[1])] for row in corners] == [
        cell.h00 + n * layout.LANES for n in range(4)
    ]
    assert layout.CubicRows._field_defaults["coef"] == 16 * layout.ALL
