"""Compile notice on a terminal, and a pause of the garbage collector, while kernels compile."""

from __future__ import annotations

import gc
import sys
from typing import Any

from numba.core import event

NOTICE = "rockerbogie: compiling kernels for this machine, once, about a minute (in advance: rockerbogie compile)"


class _CompileListener(event.Listener):  # type: ignore[misc]
    """Listener of numba's compile events, for this package's kernels only.

    Compilation keeps nearly all objects that it creates: searching them for garbage took one eighth of the time.
    """

    def __init__(self) -> None:
        self.kernels: set[int] = set()  # ids of the dispatchers, which live as long as the process
        self.depth, self.count, self.noticed, self.collects = 0, 0, False, False

    def _is_kernel(self, found: event.Event) -> bool:
        """Return True if an event is about a kernel of this package.

        Args:
            found: event of the compiler.
        """
        return isinstance(found.data, dict) and id(found.data.get("dispatcher")) in self.kernels

    def on_start(self, found: event.Event) -> None:
        """Print the notice and pause the garbage collector, unless a caller is being compiled.

        Args:
            found: event of the compiler.
        """
        if not self._is_kernel(found):
            return
        self.depth += 1
        self.count += 1
        if self.depth > 1:  # a callee
            return
        self.collects = gc.isenabled()
        gc.disable()
        self.show()

    def show(self) -> None:
        """Print the notice on a terminal, once."""
        if not self.noticed and sys.stderr is not None and sys.stderr.isatty():
            print(NOTICE, file=sys.stderr, flush=True)
        self.noticed = True

    def on_end(self, found: event.Event) -> None:
        """Resume the garbage collector when the chain of calls is compiled.

        Args:
            found: event of the compiler.
        """
        if not self._is_kernel(found):
            return
        self.depth -= 1
        if self.depth == 0 and self.collects:
            gc.enable()


_listener = _CompileListener()
event.register("numba:compile", _listener)


def announce(dispatcher: Any) -> None:
    """Include a dispatcher in the kernels whose compilation is announced.

    Args:
        dispatcher: result of `numba.njit`, kept for the life of the process.
    """
    _listener.kernels.add(id(dispatcher))


def show() -> None:
    """Print the notice on a terminal, once in a process."""
    _listener.show()


def silence() -> None:
    """Suppress the notice in this process, because the caller shows progress itself."""
    _listener.noticed = True


def compiled_count() -> int:
    """Return the number of kernels compiled so far in this process, by signature, with callees."""
    return _listener.count
