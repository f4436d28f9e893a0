"""Kernels in plain Python for the first poses, while another process compiles them.

A kernel takes 10 to 20 s to compile, and a single pose about 0.1 s in plain Python. The first calls on a few items therefore run
a second copy of the package `_kernels`, in which no function is compiled. A process in the background compiles the kernels
that were called, stores them in the disk cache, and ends. Results differ from those of compiled kernels by less than 1e-9.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import cache, notice
from .mode import PLAIN_PACKAGE

#: Largest batch that runs in plain Python.
FEW = 4
#: Environment variable: 1 compiles a kernel before its first call, however small the batch.
WAIT = "ROCKERBOGIE_WAIT_FOR_COMPILER"
#: Program of the process in the background.
PROGRAM = "from rockerbogie._kernels.jit.uncompiled import compile_requests; compile_requests()"


@dataclass
class FirstCalls:
    """Kernels seen compiled, and the background process."""

    plain: bool = True  # False: kernels are compiled before their first call
    ready: set[tuple[Any, ...]] = field(default_factory=set)  # kernel and types of its arguments
    process: subprocess.Popen[bytes] | None = None
    requests: set[Any] = field(default_factory=set)  # kernel and signature

    def run(self, kernel: Any, args: tuple[Any, ...], count: int, plain: Callable[..., None] | None = None) -> bool:
        """Run a batch kernel in plain Python, if it is not compiled yet and the batch is small.

        Args:
            kernel: called as `kernel(*args, 0, count)`.
            args: its arguments before the range.
            count: number of items.
            plain: called with the same arguments in place of the kernel's own code.

        Returns:
            False if nothing was done: the caller runs the compiled kernel.
        """
        key = kernel, *map(type, args)
        if key in self.ready:
            return False
        if not hasattr(kernel, "overloads") or os.environ.get(WAIT) == "1":  # a Python function, or never plain
            self.ready.add(key)
            return False
        signature = tuple(kernel.typeof_pyval(value) for value in (*args, 0, 0))
        if signature in kernel.overloads or kernel._cache.holds(signature):
            self.ready.add(key)
            return False
        if count > FEW or not self.plain:
            self._wait(kernel, signature)
            return False
        self._request(kernel, signature)
        if self.process is None or self.process.poll() is not None:
            return False
        if plain is not None:
            plain(*args, 0, count)
            return True
        try:
            with np.errstate(all="ignore"):
                plain_copy(kernel)(*map(plain_copy, args), 0, count)
        except (ArithmeticError, ValueError):  # plain Python raises where compiled code gives inf or NaN
            return False
        return True

    def _request(self, kernel: Any, signature: tuple[Any, ...]) -> None:
        """Request a kernel from the background process, which the first request starts.

        Without a writable cache folder or a Python program to start, nothing is done.

        Args:
            kernel: numba dispatcher.
            signature: types of its arguments.
        """
        if (kernel, signature) in self.requests:
            return
        self.requests.add((kernel, signature))
        try:
            if self.process is None and sys.executable and cache.is_writable(cache.cache_folders()[-1].parent):
                self.process = start_compiler()
            if self.process is not None and self.process.stdin is not None:
                pickle.dump((kernel.__module__, kernel.__name__, signature), self.process.stdin)
                self.process.stdin.flush()
        except OSError:  # it cannot be started, or has ended: the kernel is compiled when it is needed
            return

    def _wait(self, kernel: Any, signature: tuple[Any, ...]) -> None:
        """Wait until the process in the background has compiled a kernel, if it was asked to.

        Args:
            kernel: numba dispatcher.
            signature: types of its arguments.
        """
        if self.process is None or (kernel, signature) not in self.requests:
            return
        notice.show()
        while self.process.poll() is None and not kernel._cache.holds(signature):
            time.sleep(0.02)


def plain_copy(kept: Any) -> Any:
    """Return the plain Python form of a kernel, or of a named tuple that kernels take.

    Args:
        kept: any object; one that is defined outside the package `_kernels` is returned as it is.
    """
    kind, package = kept if callable(kept) else type(kept), __package__.rpartition(".")[0]
    if not kind.__module__.startswith(package + "."):
        return kept
    if PLAIN_PACKAGE not in sys.modules:
        initial = cache.SOURCES / "__init__.py"
        spec = importlib.util.spec_from_file_location(PLAIN_PACKAGE, initial, submodule_search_locations=[str(cache.SOURCES)])
        assert spec is not None
        sys.modules[PLAIN_PACKAGE] = importlib.util.module_from_spec(spec)
    made = getattr(importlib.import_module(PLAIN_PACKAGE + kind.__module__.removeprefix(package)), kind.__name__)
    return made if kind is kept else made(*map(plain_copy, kept))


def start_compiler() -> subprocess.Popen[bytes]:
    """Start a process that compiles the kernels named on its input, and outlives this one."""
    paths = [str(cache.SOURCES.parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), WAIT: "1"},
        start_new_session=True,  # an interrupt from the keyboard is not for it
    )


def compile_requests() -> None:
    """Compile the kernels that standard input names, until it ends."""
    while True:
        try:
            module, name, signature = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        getattr(importlib.import_module(module), name).compile(signature)


first_calls = FirstCalls()


@contextmanager
def compile_first() -> Iterator[None]:
    """Compile kernels before their first call inside a `with` block.

    It is for work that plain Python would slow down.

    Yields:
        None.
    """
    before, first_calls.plain = first_calls.plain, False
    try:
        yield
    finally:
        first_calls.plain = before
