"""Decorators that compile kernels, with IEEE 754 division and a disk cache (`cache`)."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import types
from numba.extending import overload

from .cache import enable_cache
from .mode import COMPILED

F = TypeVar("F", bound=Callable[..., Any])


def _compiled(function: F, **options: Any) -> Any:
    """Return the compiled form of a function, cached on disk.

    Integers written in a call count as values of their type. Otherwise numba compiles f(0), f(1) and f(True) separately.

    Args:
        function: Python function in numba's subset.
        options: further options of `numba.njit`.

    Returns:
        A numba dispatcher; the function itself in plain Python (`mode`).
    """
    if not COMPILED:
        return function
    made = numba.njit(error_model="numpy", **options)(function)
    enable_cache(made)
    choose = made.get_call_template
    made.get_call_template = lambda args, kws: choose(tuple(_without_value(a) for a in args), kws)
    return made


def _without_value(kind: Any) -> Any:
    """Return the type of an argument, without the value if it is an integer or a bool literal.

    Args:
        kind: numba type.

    Returns:
        The type of all such values, or the same type.
    """
    literal = isinstance(kind, types.Literal) and isinstance(kind.literal_value, int)  # a bool is an int
    return types.unliteral(kind) if literal else kind  # type: ignore[attr-defined]


def njit(function: F) -> F:
    """Compile a scalar kernel, which borrows its arrays.

    It counts no references: its caller owns all arrays while it runs. It therefore makes no array and returns none, nor does it
    copy one slice to another, for which numba may make one: `owning_njit` compiles a kernel that does. It releases Python's
    global lock, so that several threads can work on one batch.

    Args:
        function: Python function in numba's subset.

    Returns:
        The compiled function.
    """
    made: F = _compiled(function, nogil=True, _nrt=False)
    return made


def owning_njit(function: F) -> F:
    """Compile as `njit`, with reference counts.

    It is for a kernel that makes or returns arrays, or copies slices.

    Args:
        function: Python function in numba's subset.

    Returns:
        The compiled function.
    """
    made: F = _compiled(function, nogil=True, _nrt=True)
    return made


def fma_njit(function: F) -> F:
    """Compile as `njit`, with fused multiply-add.

    A product and the sum it enters may be rounded once, together, where the processor can.

    Args:
        function: Python function in numba's subset.

    Returns:
        The compiled function.
    """
    made: F = _compiled(function, nogil=True, _nrt=False, fastmath={"contract"})
    return made


def owning_fma_njit(function: F) -> F:
    """Compile as `owning_njit`, with fused multiply-add.

    Args:
        function: Python function in numba's subset.

    Returns:
        The compiled function.
    """
    made: F = _compiled(function, nogil=True, _nrt=True, fastmath={"contract"})
    return made


def force_inlined(function: F) -> F:
    """Compile as `njit` a kernel whose machine code LLVM inserts into its caller's.

    It is for kernels for which passing the arguments would cost too much.

    Args:
        function: Python function in numba's subset.

    Returns:
        The compiled function.
    """
    made: F = _compiled(function, nogil=True, _nrt=False, forceinline=True)
    return made


def inlined(function: F) -> F:
    """Compile a kernel as part of its caller's source: a small one, or one with a single caller.

    LLVM optimises each kernel of a chain of calls again together with all its callees, so a shorter chain compiles faster.

    Args:
        function: Python function in numba's subset.

    Returns:
        The compiled function.
    """
    if not COMPILED:
        return function
    made: F = numba.njit(error_model="numpy", inline="always")(function)
    enable_cache(made)
    return made


Maker = Callable[[type], Callable[..., Any]]


def specialize_on_ground(function: Callable[..., Any]) -> Callable[[Maker], Maker]:
    """Return a decorator that makes compiled calls depend on the type of the terrain.

    The terrain is the first argument of `function`. Code for one interpolation is then not compiled for the other.
    In plain Python, `function` runs as it is written.

    Args:
        function: plain Python function whose first argument is the packed terrain.

    Returns:
        A decorator for a function that takes the type of the terrain and returns the function to compile.
    """

    def register(make: Maker) -> Maker:
        """Register a maker of functions for numba, and return it.

        Args:
            make: takes the type of the terrain and returns the function to compile.
        """

        def choose(ground: Any, *rest: Any) -> Any:
            """Return the function to compile for the types of a call.

            Args:
                ground: numba type of the terrain.
                rest: numba types of the other arguments.
            """
            return make(ground.instance_class)

        choose.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
        if COMPILED:
            overload(function, inline="always", strict=False, jit_options={"error_model": "numpy"})(choose)
        return make

    return register
