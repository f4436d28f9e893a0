"""`njit`, defined once: cached on disk, IEEE division, nan kept as nan."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

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
