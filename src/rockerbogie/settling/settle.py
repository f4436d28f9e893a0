"""Settle: the rover's pose on the ground, given where it stands and where it heads."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels import batch
from .._kernels.jit.decorators import parallel_for
from .._kernels.solve import equilibrium
from ..arrays import Array, flat, flat_steering, pieces, spanned
from ..errors import RockerbogieError, expect
from ..rover.frames import check_steering
from ..rover.model import LOAD_ROVER, Rover
from ..terrain.heightfield import Terrain
from .pose import Pose
from .status import Status

Mode = Literal["contact", "equilibrium"]
HEADINGS = 64  # parts of half a turn
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
    if mode not in ("contact", "equilibrium"):
        raise RockerbogieError(f"mode {mode!r} is not known; give 'contact' or 'equilibrium'")
    px, py, heading = _numbers("x", x), _numbers("y", y), _numbers("yaw", yaw)
    turn = check_steering(rover, steering)
    try:
        shape = np.broadcast(px, py, heading, turn[..., 0]).shape
    except ValueError as error:
        shapes = f"{px.shape}, {py.shape}, {heading.shape}"
        raise RockerbogieError(f"x, y, yaw of shapes {shapes} and steering {turn.shape} do not broadcast together") from error
    px, py, heading, turn = spanned(px, shape), spanned(py, shape), spanned(heading, shape), spanned(turn, (*shape, 6))
    q = np.empty((*shape, 6))
    status = np.empty(shape, dtype=np.uint8)
    report = np.empty((*shape, equilibrium.R_SIZE)) if mode == "equilibrium" else None
    for at in pieces(shape, CHUNK):
        spots = (flat(px[at]), flat(py[at]), flat(heading[at]), flat_steering(turn[at]), q[at].reshape(-1, 6))
        given, codes = (terrain.packed, rover.packed, *spots), status[at].reshape(-1)
        if report is None:
            if terrain.interpolation == "cubic":
                parallel_for(batch.settle_cubic, codes.size, *given, codes)
            else:
                order = _by_heading(spots[2]) if rover.wheel_width.any() else np.arange(codes.size)
                parallel_for(batch.settle_linear, codes.size, *given, codes, order)
            left = np.flatnonzero(codes == batch.UNSETTLED)
            if left.size > 0:
                parallel_for(batch.settle_left, left.size, *given, codes, left)
        else:
            forces = report[at].reshape(-1, equilibrium.R_SIZE)
            parallel_for(batch.rest_batch, codes.size, *given, codes, forces)
            left = np.flatnonzero((codes == Status.TIPPED) | (codes == Status.NOT_CONVERGED))
            if left.size > 0:  # search again from the six-wheel pose
                parallel_for(batch.settle_left, left.size, *given, codes.copy(), left)
                parallel_for(batch.rest_left, left.size, *given, codes, forces, left)
    return Pose(rover, terrain, px, py, heading, turn, q, status, report)


def _by_heading(yaw: Array) -> NDArray[np.int64]:
    """An order (n,) in which poses of like headings, or opposite ones, come together: wheels side by side in lanes then lie over
    cells in the same way. Whatever the order, every pose is the same."""
    with np.errstate(invalid="ignore"):  # a heading turned round 1e18 times is in no order
        part = np.floor(yaw * (HEADINGS / np.pi)).astype(np.int64) & (HEADINGS - 1)
    return np.argsort(part.astype(np.uint8), kind="stable")


def _numbers(name: str, value: ArrayLike) -> Array:
    """A place or heading as an array of finite numbers."""
    try:
        place = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise RockerbogieError(f"{name} is not a number or an array of numbers: {error}") from error
    # a lone number is asked by itself: numpy takes ten times as long about it
    if not (math.isfinite(place) if place.ndim == 0 else np.isfinite(place).all()):
        bad = ~np.isfinite(place)
        raise RockerbogieError(
            f"{name} is not finite in {bad.sum()} of {place.size} poses (first at index {int(np.argmax(bad))})"
        )
    return place
