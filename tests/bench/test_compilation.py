"""Compilation in advance of every kernel that is called from Python, and its report."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest

import rockerbogie as rb
from rockerbogie._kernels.batch import contact_mode, contacts, coverage, equilibrium_mode
from rockerbogie._kernels.dynamics import rollout
from rockerbogie._kernels.jit.uncompiled import first_calls
from rockerbogie._kernels.model import ground, jacobians
from rockerbogie._kernels.odometry import commands, frames, twist
from rockerbogie._kernels.soil import forces, table
from rockerbogie._kernels.statics import frictionless, loads
from rockerbogie._kernels.verify import gap
from rockerbogie.bench import compilation
from rockerbogie.cli import main
from rockerbogie.figures import raster_kernels
from support.patience import PATIENCE

#: Kernels called from Python, and the number of their signatures: 2 where the two kinds of terrain have code of their own.
SIGNATURES = {
    contact_mode.settle_cubic: 1, contact_mode.settle_linear: 1, contact_mode.settle_left: 2, contact_mode.settle_bridged: 1,
    equilibrium_mode.equilibrium_batch: 2, equilibrium_mode.equilibrium_left: 2, equilibrium_mode.equilibrium_bridged: 2,
    contacts.contacts_batch: 2, contacts.clearance_batch: 2, ground.surface_batch: 2, gap.verify_batch: 1,
    coverage.refuse_uncovered: 1, coverage.refuse_far: 1, loads.belly_batch: 2, loads.loads_batch: 1, loads.stability_batch: 1,
    loads.span_batch: 2, frictionless.line_support_batch: 1,
    rollout.predict_batch: 2,
    forces.forces_batch: 1, forces.motion_batch: 1, table.table_batch: 1, table.motion_table_batch: 1,
    commands.commands_batch: 1, twist.twist_batch: 1, jacobians.wheel_jacobians_batch: 1,
    frames.wheel_frames_batch: 1, frames.contact_planes_batch: 1,
    raster_kernels.shade: 1, raster_kernels.rasterise: 1,
}  # fmt: skip
#: Ordinary use of one pose and of many, in a process that may not compile.
USE = """
import numpy as np
import rockerbogie as rb
from rockerbogie._kernels.jit.notice import compiled_count
rover = rb.load_rover("sawppy")
rng = np.random.default_rng(1)
for interpolation in ("cubic", "linear"):
    terrain = rb.surfaces.fractal(3, size=8.0, spacing=0.05, interpolation=interpolation)
    for shape in ((), (700,), (3, 2)):
        x, y, yaw = rng.uniform(-3, 3, (3, *shape))
        for mode in ("contact", "equilibrium"):
            pose = rb.settle(rover, terrain, x, y, yaw, steering=np.zeros((*shape, 6)), mode=mode)
            pose.gap, pose.contact_angle, pose.clearance, rb.wheel_jacobians(rover, pose)
            rb.wheel_loads(pose)
            rb.wheel_commands(rover, pose, np.zeros(6)), rb.body_twist(rover, pose, gyro=np.zeros(3))
        rb.stability(pose)
    rb.verify(pose)
    terrain.normal(x, y)
    z = terrain.z.copy()
    z[60:80, 60:80] = np.nan
    gaps = rb.Terrain.from_array(z, terrain.spacing, terrain.origin, interpolation=interpolation)
    for mode in ("contact", "equilibrium"):
        rb.settle(rover, gaps, x, y, yaw, mode=mode)
    rb.drive(rover, terrain, rb.Path.straight((-1.0, 0.0), 0.0, 1.0), speed=0.1)
    rb.predict(rover, terrain, None, rb.Path.straight((-0.5, 0.0), 0.0, 0.5), friction=0.7)
soil = rb.load_soil("dry-sand")
rb.wheel_soil_forces(soil, [0.1, 0.2], 0.1, np.full(700, 50.0)[:, None], 0.1)
rb.wheel_soil_forces(rb.Coulomb(0.5), 0.1, 0.1, 50, 0, 0.1, passes=2)
print(compiled_count())
"""


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
def test_every_kernel_is_compiled_in_advance(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps: list[tuple[int, int]] = []

    def progress(done: int, total: int) -> None:
        steps.append((done, total))
        assert done == total or not first_calls.plain, "plain Python would compute the small inputs of the steps"

    compiled = rb.compile_kernels(progress)
    assert {kernel.__name__: len(kernel.signatures) for kernel in SIGNATURES} == {
        kernel.__name__: count for kernel, count in SIGNATURES.items()
    }
    total = sum(compilation.STEPS.values())
    assert steps == [(done, total) for done in range(total + 1)]
    assert any(compiled.folder.glob("*.nbc"))
    used = subprocess.run([sys.executable, "-c", USE], capture_output=True, text=True, check=True)
    assert used.stdout.strip() == "0", "a function in ordinary use has a kernel that was not compiled"
    assert main(["compile", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) | {"seconds": 0.0} == {
        "folder": str(compiled.folder),
        "kernels": 0,
        "seconds": 0.0,
    }
    assert main(["compile"]) == 0
    assert capsys.readouterr().out == f"all kernels were compiled already: {compiled.folder}\n"


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
def test_the_second_process_ends_with_the_first(tmp_path: Path) -> None:
    """Kill the first while the second compiles: the pipe that both write to then ends."""
    code = "import time; from rockerbogie.bench import compilation; second = compilation.start_second(); time.sleep(1e4)"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE) as first:
        try:
            end = time.monotonic() + PATIENCE
            while not any(tmp_path.rglob("*.nbc")):
                assert time.monotonic() < end, "the second process stored nothing"
                time.sleep(0.1)
        finally:
            first.kill()
        assert first.communicate(timeout=PATIENCE) == (b"", None)


def test_disabled_compiler_is_refused() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from rockerbogie.cli import main; raise SystemExit(main(['compile']))"],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == "rockerbogie: NUMBA_DISABLE_JIT is set, so that nothing is compiled: unset it, then compile\n"
