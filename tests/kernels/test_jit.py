"""Compile notice, and the parallel loop over a batch."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rockerbogie._kernels.jit.parallel import parallel_for, threads

SCRIPT = """
import gc
import numpy as np
from rockerbogie._kernels.model.sincos import sincos
a = np.zeros(3)
sincos(a, 3, np.empty(3), np.empty(3))
print(gc.isenabled(), len(sincos.signatures) if hasattr(sincos, "signatures") else 1)
"""


def first_use(cache: Path, *, terminal: bool) -> tuple[str, str]:
    """Return stdout and stderr of a process that uses a kernel and the cache folder `cache`."""
    pty = pytest.importorskip("pty", reason="needs a pseudo-terminal")
    env = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "NUMBA_DISABLE_JIT": "0"}
    ours, theirs = pty.openpty()
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env=env,
        stdout=subprocess.PIPE,
        stderr=theirs if terminal else subprocess.PIPE,
        check=True,
    )
    os.close(theirs)
    said = b"" if terminal else done.stderr
    while terminal:
        try:
            part = os.read(ours, 4096)
        except OSError:  # the end of a terminal on Linux
            break
        if not part:
            break
        said += part
    os.close(ours)
    return done.stdout.decode(), said.decode()


def test_compilation_is_announced_once_on_a_terminal(tmp_path: Path) -> None:
    out, said = first_use(tmp_path, terminal=True)
    assert out.split() == ["True", "1"]
    assert said.count("rockerbogie: compiling kernels for this machine") == 1
    assert first_use(tmp_path, terminal=True)[1] == "", "compiled kernels are kept"


def test_compilation_is_not_announced_without_a_terminal(tmp_path: Path) -> None:
    out, said = first_use(tmp_path, terminal=False)
    assert out.split() == ["True", "1"]
    assert said == ""


@pytest.mark.parametrize("count", [0, 1, 512, 513, 5000, 100_001])
def test_every_item_is_computed_once_by_any_number_of_threads(count: int) -> None:
    for workers in (1, 2, None):
        done = np.zeros(count, dtype=np.int64)

        def kernel(out: np.ndarray, start: int, stop: int) -> None:
            out[start:stop] += 1

        with threads(workers):
            parallel_for(kernel, count, done)
        assert (done == 1).all()


def test_exception_of_a_kernel_ends_the_batch_and_is_raised() -> None:
    def kernel(start: int, stop: int) -> None:
        if start:
            raise ZeroDivisionError

    with threads(None), pytest.raises(ZeroDivisionError):
        parallel_for(kernel, 5000)
