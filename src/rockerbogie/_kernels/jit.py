"""`njit`, defined once: cached on disk, IEEE division, nan kept as nan."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba


def _drop_stale_cache() -> None:
    """Delete compiled kernels older than any kernel's source: numba itself looks only at the one file a function is in,
    and would go on using a callee's old code."""
    here = Path(__file__).parent
    newest = max(file.stat().st_mtime for file in here.glob("*.py"))
    for file in (here / "__pycache__").glob("*.nb?"):
        with contextlib.suppress(OSError):  # another process may be doing the same
            if file.stat().st_mtime < newest:
                file.unlink()


_drop_stale_cache()

F = TypeVar("F", bound=Callable[..., Any])


def njit(function: F) -> F:
    """Compile a scalar kernel."""
    return numba.njit(cache=True, error_model="numpy")(function)


def inlined(function: F) -> F:
    """Compile a kernel that is copied into its caller."""
    return numba.njit(cache=True, error_model="numpy", inline="always")(function)


def pnjit(function: F) -> F:
    """Compile a parallel loop over a batch."""
    return numba.njit(cache=True, error_model="numpy", parallel=True)(function)


prange = numba.prange
