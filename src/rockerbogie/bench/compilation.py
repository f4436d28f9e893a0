"""Compilation of all kernels in advance, by calls of the public functions on small inputs."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from .._kernels.jit import cache, mode, notice
from .._kernels.jit.uncompiled import compile_first
from ..errors import RockerbogieError

if TYPE_CHECKING:
    from ..logs.odometry_filter import OdometryFilter

#: Slope (rad) on which no rover has an equilibrium: the mode then starts its second search.
TOO_STEEP = 1.3

Interpolation = Literal["cubic", "linear"]
Group = Literal[Interpolation, "common"]

#: Number of steps of each group, in the order in which `compile_kernels` takes the groups.
STEPS: dict[Group, int] = {"cubic": 12, "common": 11, "linear": 12}
#: Program of the second process: the kernels of bilinear terrain share few callees with the others.
PROGRAM = "from rockerbogie.bench.compilation import run_second; run_second('linear')"


class Compiled(NamedTuple):
    """Result of `compile_kernels`."""

    folder: Path  #: folder that holds the compiled kernels
    kernels: int  #: number of kernels compiled by this call; 0 if all were in the folder
    seconds: float  #: time it took, s


def compile_kernels(progress: Callable[[int, int], None] | None = None) -> Compiled:
    """Compile all kernels for this machine and store them, so that no later call has to.

    Kernels that are stored already are loaded. Install scripts and container images call this once. The processor is
    part of the key: for other machines, set NUMBA_CPU_NAME and NUMBA_CPU_FEATURES to the same values here and there.

    Args:
        progress: called as `progress(done, total)` after each of some steps, which take unequal times.

    Returns:
        The folder, the number of kernels compiled, and the time.

    Raises:
        RockerbogieError: NUMBA_DISABLE_JIT is set, or no cache folder is writable.
    """
    if not mode.COMPILED:
        raise RockerbogieError("NUMBA_DISABLE_JIT is set, so that nothing is compiled: unset it, then compile")
    folders = [folder.parent for folder in cache.cache_folders()]
    if not cache.is_writable(folders[-1]):
        found = " nor ".join(str(folder) for folder in folders)
        raise RockerbogieError(f"cannot write to {found}: set NUMBA_CACHE_DIR to a writable folder, now and in later use")
    if progress is not None:
        notice.silence()
    before, stored, start = notice.compiled_count(), _stored(), time.perf_counter()
    total, second = sum(STEPS.values()), None
    steps = ((group, step) for group in STEPS for step in _steps(group))
    try:
        with compile_first():
            for done, (group, step) in enumerate(steps):
                if progress is not None:
                    progress(done, total)
                if second is not None and group == "linear":
                    second.wait()  # the steps load what it has stored, and compile the rest
                step()
                if second is None and group != "linear" and notice.compiled_count() > before and (os.cpu_count() or 1) > 1:
                    second = start_second()
    finally:
        if second is not None:
            second.kill()
            second.communicate()  # waits, and closes the pipe
    if progress is not None:
        progress(total, total)
    return Compiled(cache.cache_folders()[-1], len(_stored() - stored), time.perf_counter() - start)


def start_second() -> subprocess.Popen[bytes]:
    """Start the second process; it ends when this one ends, in whatever way.

    Returns:
        The process.
    """
    return subprocess.Popen([sys.executable, "-c", PROGRAM], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)


def run_second(group: Group) -> None:
    """Make the calls of one group, until the process that started this one ends.

    Args:
        group: a key of `STEPS`.
    """
    threading.Thread(target=_end_with_input, daemon=True).start()
    with compile_first():
        for step in _steps(group):
            step()


def _end_with_input() -> None:
    """End this process when its standard input ends.

    That is a pipe from the process that started this one; the system closes it when that process ends.
    """
    while os.read(0, 64):
        pass
    os._exit(1)


def _stored() -> set[str]:
    """Return the names of the files of compiled kernels in the folder that they are written to."""
    return {file.name for file in cache.cache_folders()[-1].glob("*.nbc")}


def _steps(group: Group) -> Iterator[Callable[[], object]]:
    """Yield the calls that compile the kernels of a group, in order.

    Args:
        group: a key of `STEPS`.
    """
    return _common_steps() if group == "common" else _steps_on(group)


def _steps_on(interpolation: Interpolation) -> Iterator[Callable[[], object]]:
    """Yield the calls that compile the kernels of one interpolation, in order.

    Args:
        interpolation: of the terrain.
    """
    from ..motion.path import Path
    from ..motion.prediction.predict import predict
    from ..rover.formats import load_rover
    from ..settling.settle import settle
    from ..settling.verification import verify
    from ..statics.loads import wheel_loads
    from ..statics.stability import force_values
    from ..terrain import surfaces
    from ..terrain.heightfield import Terrain

    rover = load_rover("curiosity")
    far = [0.0, 1e4]  # the second pose is off the map, so it is computed by the scalar kernels
    level = surfaces.plane(size=12.0, spacing=0.5, interpolation=interpolation)
    steep = surfaces.plane(TOO_STEEP, size=12.0, spacing=0.5, interpolation=interpolation)
    yield partial(level.height, 0.0, 0.0)
    yield partial(settle, rover, level, far, 0.0)
    yield partial(settle, rover, steep, far, 0.0, mode="equilibrium")
    still = settle(rover, level, 0.0, 0.0, mode="equilibrium")
    yield partial(wheel_loads, still)
    yield partial(getattr, still, "support")
    z = level.z.copy()
    z[::2, ::2] = np.nan
    gaps = Terrain.from_array(z, level.spacing, level.origin, interpolation=interpolation)
    yield partial(settle, rover, gaps, 0.0, 0.0)
    yield partial(settle, rover, gaps, 0.0, 0.0, mode="equilibrium")
    pose = settle(rover, level, 0.0, 0.0)
    yield partial(getattr, pose, "gap")
    yield partial(getattr, pose, "clearance")
    yield partial(predict, rover, level, None, Path.straight((0.0, 0.0), 0.0, 0.1), friction=0.8, details=False)
    yield partial(verify, pose)
    yield partial(force_values, pose, ("tip_margin",))


def _common_steps() -> Iterator[Callable[[], object]]:
    """Yield the calls that compile the kernels of both interpolations, in order."""
    from ..figures.render import Camera, Mesh, render
    from ..logs.odometry import odometry
    from ..logs.odometry_filter import OdometryFilter
    from ..motion.body_twist import body_twist
    from ..motion.drive import drive
    from ..motion.jacobian import wheel_jacobians
    from ..motion.path import Path
    from ..motion.wheel_commands import straight
    from ..motion.wheel_controller import WheelController
    from ..rover.formats import load_rover
    from ..settling.settle import settle
    from ..statics.stability import stability
    from ..terrain import surfaces
    from ..terrain.soil.forces import wheel_soil_forces
    from ..terrain.soil.load import load_soil
    from ..terrain.soil.table import tabulate

    rover, level = load_rover("curiosity"), surfaces.plane(size=12.0, spacing=0.5, interpolation="cubic")
    pose = settle(rover, level, 0.0, 0.0)
    yield partial(wheel_jacobians, rover, pose)
    yield partial(getattr, pose, "axle_frames")
    yield partial(body_twist, rover, pose)
    yield partial(stability, pose)
    soil = load_soil("lunar-lrv-b")
    yield partial(wheel_soil_forces, soil, 0.25, 0.4, 500.0, 0.1)
    table = tabulate(soil, 0.25, 0.4, (100.0, 500.0), size=(6, 7, 6))
    yield partial(table.forces, 300.0, 0.1)
    yield partial(table.motion_forces, 300.0, 1.0, 0.9, 0.0)
    yield partial(odometry, rover, None, drive(rover, level, Path.straight((0.0, 0.0), 0.0, 0.1), speed=0.1))
    yield partial(_filter_rows, OdometryFilter(rover))
    yield partial(WheelController(rover).command, straight(0.1))
    triangle = Mesh.flat(np.eye(3)[None], (1.0, 1.0, 1.0))
    yield partial(render, triangle, Camera.framing(triangle.corners, 0.5, 0.5, (8, 8)), sun=(0.5, 0.8))


def _filter_rows(odometer: OdometryFilter) -> None:
    """Feed an odometry filter two rows, and read its tip margin."""
    for t in (0.0, 1.0):
        _ = odometer.update(t, {"wheel_rate": np.zeros(6)}, {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}).tip_margin
