"""First calls on a few items: plain Python, while another process compiles."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.jit import mode, parallel, uncompiled

pytestmark = pytest.mark.skipif(not mode.COMPILED, reason="nothing is compiled")

#: Settles one pose on each kind of terrain, then says how many kernels this process has compiled.
ONE_POSE = """
import numpy as np
import rockerbogie as rb
from rockerbogie._kernels.jit.notice import compiled_count
z = np.random.default_rng(1).normal(0.0, 0.03, (60, 60))
for interpolation in ("linear", "cubic"):
    pose = rb.settle(rb.load_rover("osr"), rb.Terrain.from_array(z, 0.1, interpolation=interpolation), 3.0, 3.0, 0.3)
    print(float(pose.z), float(pose.roll), float(pose.clearance), int(pose.status))
print(compiled_count())
"""
#: Replaces the process in the background by one that compiles nothing.
IDLE = """
import subprocess, sys
import rockerbogie._kernels.jit.uncompiled as u
u.start_compiler = lambda: subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.buffer.read()"], stdin=subprocess.PIPE)
"""
#: Calls a small kernel of its own until it is compiled.
SMALL = """
import os, sys, time
import numpy as np
from rockerbogie._kernels.jit import parallel
from rockerbogie._kernels.jit.notice import compiled_count
from rockerbogie._kernels.model import doubling
out = np.zeros(8)
parallel.parallel_for(doubling.double, 2, np.arange(8.0), out)
print(out[:3], compiled_count(), parallel.first_calls.process is not None)
parallel.parallel_for(doubling.double, 8, np.arange(8.0), out)
print(out[-1], compiled_count())
"""
DOUBLING = """
from ..jit.decorators import njit

@njit
def double(given, out, start, stop):
    for k in range(start, stop):
        out[k] = 2.0 * given[k]
"""


def run(script: str, **environment: str) -> list[str]:
    """Run a script in a new process that does not wait; return the lines of its output."""
    env = {name: value for name, value in os.environ.items() if name != uncompiled.WAIT} | environment
    return subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True, check=True).stdout.splitlines()


def test_first_pose_compiles_nothing_and_equals_the_compiled_one(tmp_path: Path) -> None:
    script = f"{IDLE}{ONE_POSE}"
    *first, count = run(script, NUMBA_CACHE_DIR=str(tmp_path))
    assert count == "0"
    assert not list(tmp_path.iterdir())
    assert all(line.endswith(" 0") for line in first)
    compiled = run(ONE_POSE, **{uncompiled.WAIT: "1"})[:-1]
    for one, other in zip(first, compiled, strict=True):
        assert np.allclose([float(v) for v in one.split()], [float(v) for v in other.split()], rtol=0.0, atol=1e-9)


def test_kernel_called_first_is_compiled_by_another_process(tmp_path: Path) -> None:
    package = tmp_path / "rockerbogie"
    package.mkdir()
    source = Path(rb.__file__).parent
    for path in source.rglob("*.py"):
        copy = package / path.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (package / "_kernels" / "model" / "doubling.py").write_text(DOUBLING)
    use = {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run(SMALL, **use) == ["[0. 2. 0.] 0 True", "14.0 0"]
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 1
    assert run(SMALL, **use) == ["[0. 2. 0.] 0 False", "14.0 0"]
    use["NUMBA_CACHE_DIR"] = str(tmp_path / "other")
    alone = "import rockerbogie._kernels.jit.uncompiled as u\nu.start_compiler = lambda: None\n"
    assert run(alone + SMALL, **use) == ["[0. 2. 0.] 1 False", "14.0 1"]
    use["NUMBA_CACHE_DIR"] = str(tmp_path / "third")
    first = "import rockerbogie._kernels.jit.uncompiled as u\nkept = u.compile_first()\nkept.__enter__()\n"
    assert run(first + SMALL, **use) == ["[0. 2. 0.] 1 False", "14.0 1"]


class Plain:
    """Every batch in plain Python, whether its kernel is compiled or not."""

    def run(self, kernel: Any, args: tuple[Any, ...], count: int, plain: Any = None) -> bool:
        with np.errstate(all="ignore"):
            uncompiled.plain_copy(kernel)(*map(uncompiled.plain_copy, args), 0, count)
        return True


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_every_quantity_is_the_same_in_plain_python(mode: Any, interpolation: str, monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = rb.surfaces.fractal(5, size=8.0, spacing=0.1, interpolation=interpolation)
    rover = rb.load_rover("sawppy")

    def all_of() -> list[Any]:
        pose = rb.settle(rover, terrain, [0.3, 1e4], 0.2, 1.0, mode=mode)
        loads, margins = rb.wheel_loads(pose), rb.stability(pose)
        there = rb.settle(rover, terrain, 0.3, 0.2, 1.0, mode=mode)
        return [
            pose.status, pose.z, pose.tilt, pose.rocker, pose.bogie, pose.gap, pose.contact_point, pose.contact_normal,
            pose.clearance, terrain.normal(0.1, 0.2), rb.wheel_jacobians(rover, there),
            loads.normal, loads.required_friction, margins.tip_margin, rb.verify(there).passes(),
        ]  # fmt: skip

    compiled = all_of()
    monkeypatch.setattr(parallel, "first_calls", Plain())
    for one, other in zip(all_of(), compiled, strict=True):
        assert np.allclose(one, other, rtol=1e-6, atol=1e-9, equal_nan=True)
