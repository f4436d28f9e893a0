"""Interrupts that Python drops."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

#: Time after which a dropped interrupt is sent again: the callback that dropped it has returned, s.
AGAIN = 0.01


@contextmanager
def repeat_dropped() -> Iterator[None]:
    """Send an interrupt again that Python has dropped.

    Python cannot raise from the callback of a weak reference, a finalizer or a callback of ctypes. An interrupt that
    arrives there is reported and dropped, and the program continues: about one in forty while a map is made.

    Yields:
        None; on leaving, Python drops interrupts as before.
    """
    import os
    import signal
    import threading

    before = sys.unraisablehook

    def hook(dropped: Any) -> None:
        if dropped.exc_type is not KeyboardInterrupt:
            before(dropped)
            return
        timer = threading.Timer(AGAIN, os.kill, (os.getpid(), signal.SIGINT))
        timer.daemon = True
        timer.start()

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
