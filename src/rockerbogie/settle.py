"""Settle: the rover's pose on the ground, given where it stands and where it heads."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ._kernels import batch, equilibrium
from ._kernels.jit import spread
from .errors import RockerbogieError, expect
from .frames import check_steering
from .pose import Pose
from .rover import LOAD_ROVER, Rover
from .terrain import Terrain

Mode = Literal["contact", "equilibrium"]
CHUNK = 1 << 20  # poses handed to the kernel at once: bounds what a broadcast input costs in memory


def settle(
    rover: Rover,
    terrain: Terrain,
    x: ArrayLike,
    y: ArrayLike,
    yaw: ArrayLike = 0.0,
    *,
    steering: ArrayLike | None = None,
    mode: Mode = "contact",
) -> Pose:
    """Let the rover down on the ground at (x, y) with heading yaw: eqs 13-16 with exact contact over the whole tread.

    Args:
        x, y: (...) of the body's reference point, m, in the terrain's frame.
        yaw: (...) heading from +x, counter-clockwise, rad.
        steering: (..., 6) steering angle of each wheel, left turn positive, rad; 0 for wheels that do not steer.
        mode: "contact", the paper's: all six wheels touch. "equilibrium": the rover comes to rest under its own
            weight; wheels may hang, joints rest on their stops, the belly touch.

    Returns:
        Pose with batch axes from broadcasting x, y, yaw and steering's leading axes. Hard ground never raises: a pose
        that could not be had is nan, and its `status` says why (`rockerbogie.Status`).

    Raises:
        RockerbogieError: x, y or yaw not finite or not broadcastable, steering that does not fit the rover.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_array, from_raster or rockerbogie.surfaces")
    places = []
    for name, value in (("x", x), ("y", y), ("yaw", yaw)):
        try:
            place = np.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise RockerbogieError(f"{name} is not a number or an array of numbers: {error}") from error
        places.append(place)
        bad = ~np.isfinite(place)
        if bad.any():
            raise RockerbogieError(
                f"{name} is not finite in {bad.sum()} of {place.size} poses (first at index {int(np.argmax(bad))})"
            )
    if mode not in ("contact", "equilibrium"):
        raise RockerbogieError(f"mode {mode!r} is not known; give 'contact' or 'equilibrium'")
    turn = check_steering(rover, steering)
    try:
        shape = np.broadcast_shapes(*(p.shape for p in places), turn.shape[:-1])
    except ValueError as error:
        shapes = ", ".join(str(p.shape) for p in places)
        raise RockerbogieError(f"x, y, yaw of shapes {shapes} and steering {turn.shape} do not broadcast together") from error
    px, py, heading = (np.broadcast_to(p, shape) for p in places)
    turn = np.broadcast_to(turn, (*shape, 6))
    n = int(np.prod(shape))
    q = np.empty((n, 6))
    status = np.empty(n, dtype=np.uint8)
    report = np.empty((n, equilibrium.R_SIZE)) if mode == "equilibrium" else None
    one_steering = n > 0 and all(step == 0 for step in turn.strides[:-1])
    turns = turn[(0,) * (turn.ndim - 1)].reshape(1, 6) if one_steering else turn.reshape(-1, 6)
    for start in range(0, n, CHUNK):
        part = slice(start, min(start + CHUNK, n))
        spots = (px.flat[part], py.flat[part], heading.flat[part], np.ascontiguousarray(turns if one_steering else turns[part]))
        given = (terrain.packed, rover.packed, *spots)
        if report is None:
            spread(batch.settle_batch, len(status[part]), *given, q[part], status[part])
        else:
            spread(batch.rest_batch, len(status[part]), *given, q[part], status[part], report[part])
    if report is not None:
        report = report.reshape(*shape, equilibrium.R_SIZE)
    return Pose(rover, terrain, px, py, heading, turn, q.reshape(*shape, 6), status.reshape(shape), report)
