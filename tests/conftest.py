"""Fixtures for all tests."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from support.data import DATA

# A first pose in plain Python differs from compiled ones in its last bits: tests that compare bits wait for the compiler.
os.environ.setdefault("ROCKERBOGIE_WAIT_FOR_COMPILER", "1")
# In the background of a shell, interrupts are ignored; the processes that tests interrupt would inherit that and run on.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def data() -> Callable[[str], Path]:
    """Return `find`, which returns the path of a file of the shared data or skips the test."""

    def find(name: str) -> Path:
        path = DATA / name
        if not path.exists():
            pytest.skip(f"{path} is not here: set ROCKERBOGIE_DATA to the folder that holds {name}")
        return path

    return find
