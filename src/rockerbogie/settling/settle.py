"""Settling: solve for the pose of a rover on terrain, given position and yaw."""

from __future__ import annotations

import math
import sys

import numpy as np
from numpy.typing import ArrayLike

from .._kernels.simd.bilinear_touch import TOUCH_SIZE
from .._kernels.solve.forces import R_SIZE
from ..arrays import Array, flat, flat_steering, floats, pieces, spanned
from ..errors import RockerbogieError, expect
from ..gravity import GRAVITY, check_gravity
from ..rover.frames import check_steering
from ..rover.model import LOAD_ROVER, Rover
from ..terrain.heightfield import Terrain
from .engines import Batch, settle_batch
from .engines import Mode as Mode
from .pose import Pose

CHUNK = 1 << 20  # poses per kernel call: bounds the memory that a broadcast input takes
NUMBER = (float, int, np.float64)  # not bool, a subclass of int
LARGEST = sys.float_info.max
NO_REPORT = np.empty((0, R_SIZE))


def settle(
    rover: Rover,
    terrain: Terrain,
    x: ArrayLike,
    y: ArrayLike,
    yaw: ArrayLike = 0.0,
    *,
    steering: ArrayLike | None = None,
    mode: Mode = "contact",
    gravity: float = GRAVITY["earth"],
) -> Pose:
    """Solve for the rover's pose at (x, y) and yaw.

    These are eqs 13-16 with exact contact over the whole tread. `settle` does not raise for difficult terrain. A pose that
    cannot be computed is NaN, and its `status` gives the reason (`rockerbogie.Status`).

    Args:
        rover: the mechanism.
        terrain: the height field.
        x, y: (...) position of the body's reference point in the terrain's frame, m.
        yaw: (...) yaw of the body from +x, counter-clockwise, rad.
        steering: (..., 6) steering angle of each wheel, left turn positive, rad; 0 for wheels that do not steer.
        mode: "contact" (the paper's): all six wheels are in contact. "equilibrium": static equilibrium without friction under
            the rover's weight, in which wheels may be off the ground, joints at their limits and the body on the terrain.
        gravity: m/s²; scales the forces of the pose, not the pose.

    Returns:
        Pose with batch axes from broadcasting x, y, yaw and the leading axes of steering.

    Raises:
        RockerbogieError: x, y or yaw not finite or not broadcastable; steering that does not fit the rover; unknown mode;
            gravity not from 0.001 to 100.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_array, from_raster or rockerbogie.surfaces")
    check_mode(mode)
    field = check_gravity(gravity)
    turn = check_steering(rover, steering)
    if turn.ndim == 1 and _is_finite(x) and _is_finite(y) and _is_finite(yaw):
        return _settle_one(rover, terrain, float(x), float(y), float(yaw), turn, mode, field)  # type: ignore[arg-type]
    return settle_with_contacts(rover, terrain, x, y, yaw, mode, field, turn, keep=False)[0]


def settle_with_contacts(
    rover: Rover, terrain: Terrain, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, mode: Mode, field: float,
    turn: Array | None = None, *, keep: bool = True,
) -> tuple[Pose, Array]:  # fmt: skip
    """Solve for poses as `settle`, and return the contacts that SIMD lanes find on the way.

    Args:
        rover, terrain, x, y, yaw, mode: as for `settle`.
        field: gravity, m/s².
        turn: (..., 6) steering angles of `check_steering`, rad. Default: 0.
        keep: False: contacts are not wanted.

    Returns:
        The poses (...), and their contacts (n, 6, TOUCH_SIZE) of `_kernels.simd.bilinear_touch`, NaN where the scalar engine
        settles. n is 0 if they are not wanted, on cubic terrain and in equilibrium mode.
    """
    keep &= mode == "contact" and terrain.interpolation == "linear"
    turn = np.zeros(6) if turn is None else turn
    px, py, facing = _numbers("x", x), _numbers("y", y), _numbers("yaw", yaw)
    try:
        shape = np.broadcast(px, py, facing, turn[..., 0]).shape
    except ValueError as error:
        shapes = f"{px.shape}, {py.shape}, {facing.shape}"
        raise RockerbogieError(f"x, y, yaw of shapes {shapes} and steering {turn.shape} do not broadcast together") from error
    px, py, facing, turn = spanned(px, shape), spanned(py, shape), spanned(facing, shape), spanned(turn, (*shape, 6))
    q = np.empty((*shape, 6))
    status = np.empty(shape, dtype=np.uint8)
    report = np.empty((*shape, R_SIZE)) if mode == "equilibrium" else None
    touch = np.full((status.size if keep else 0, 6, TOUCH_SIZE), np.nan)
    done = 0
    for at in pieces(shape, CHUNK):
        forces = NO_REPORT if report is None else report[at].reshape(-1, R_SIZE)
        settle_batch(
            mode,
            Batch(
                rover, terrain, flat(px[at]), flat(py[at]), flat(facing[at]), flat_steering(turn[at]),
                q[at].reshape(-1, 6), status[at].reshape(-1), forces,
                touch[done : done + status[at].size],
            ),
        )  # fmt: skip
        done += status[at].size
    return Pose(rover, terrain, px, py, facing, turn, q, status, report, field), touch


def _is_finite(value: object) -> bool:
    """Return True if an argument is a plain finite number."""
    return type(value) in NUMBER and -LARGEST <= value <= LARGEST  # type: ignore[operator]


def _settle_one(
    rover: Rover, terrain: Terrain, x: float, y: float, yaw: float, steering: Array, mode: Mode, gravity: float
) -> Pose:
    """Solve for one pose: as `settle`, with fewer steps in Python."""
    px, py, facing = np.array((x,)), np.array((y,)), np.array((yaw,))
    q, status = np.empty((1, 6)), np.empty(1, np.uint8)
    report = np.empty((1, R_SIZE)) if mode == "equilibrium" else NO_REPORT
    settle_batch(mode, Batch(rover, terrain, px, py, facing, flat(steering, 6), q, status, report))
    pose = object.__new__(Pose)  # its `__init__` sets the fields of a frozen class one by one, which takes 0.7 µs more
    fields = vars(pose)
    fields["rover"], fields["terrain"], fields["gravity"], fields["steering"] = rover, terrain, gravity, steering
    fields["x"], fields["y"], fields["yaw"], fields["status"] = px[0, ...], py[0, ...], facing[0, ...], status[0, ...]
    fields["q"], fields["report"] = q[0], report[0] if mode == "equilibrium" else None
    return pose


def check_mode(mode: str) -> None:
    """Check the name of a settle mode.

    Args:
        mode: the name given.

    Raises:
        RockerbogieError: it is neither "contact" nor "equilibrium".
    """
    if mode not in ("contact", "equilibrium"):
        raise RockerbogieError(f"mode {mode!r} is not known; give 'contact' or 'equilibrium'")


def _numbers(name: str, value: ArrayLike) -> Array:
    """Return an argument as an array (...) of finite floats, or raise."""
    try:
        array = floats(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise RockerbogieError(f"{name} is not a number or an array of numbers: {error}") from error
    # A single number is checked without numpy, which takes ten times as long.
    if not (math.isfinite(array) if array.ndim == 0 else np.isfinite(array).all()):
        bad = ~np.isfinite(array)
        raise RockerbogieError(
            f"{name} is not finite in {bad.sum()} of {array.size} poses (first at index {int(np.argmax(bad))})"
        )
    return array
