"""Limits of a rover: steepest slopes, highest step, widest ditch, motor torque."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..gravity import GRAVITY
from ..rover.model import Rover
from ..settling.settle import settle
from ..terrain import surfaces
from . import obstacles
from .climb import ROUNDING, Direction, check_arguments, first_failure, motor_limit, station_balance
from .loads import wheel_loads
from .obstacles import Profile
from .planar import PlanarRover, planar_rover
from .planar_forces import balance, least_friction, least_torque
from .planar_run import run_over

Array = NDArray[np.float64]

#: Stations for each length of the rover in searches.
COARSE = 40
#: Steps and ditches are searched between these sizes, in units of the smallest wheel radius and of the rover's size.
SMALLEST, LARGEST = 0.05, 1.0
GROWTH = 2.0
#: Relative error of steps and ditches; absolute error of slopes, rad.
TIGHT = 2e-3
ANGLE = np.radians(0.01)
#: Slopes of a sweep.
SWEEP = 91


@dataclass(frozen=True)
class ClimbLimits:
    """Limits of a rover on rigid terrain, for the best distribution of torques.

    Attributes:
        rover: its name.
        friction, gravity: as given.
        torque_limit: as given, or that of the rover's motors, N m; inf without a limit.
        wheel_radius: largest of the six, m.
        slope_up, slope_down, slope_across: steepest slope that it climbs, descends and stands across, rad.
        step_forward, step_backward: highest step, m.
        ditch_forward, ditch_backward: widest ditch, as deep as the rover is long, m.
        slope_torque: motor torque that `slope_up` needs, N m.
        step_torque: motor torque that the highest of both steps needs, N m, with `friction`.
        why: reason of each limit by its name: friction, torque, tip_over, belly, joint_limit or stuck (`climb.REASONS`), or
            "size" where the search ended without a limit: at one length of the rover, or a slope of almost 90°.
    """

    rover: str
    friction: float
    torque_limit: float
    gravity: float
    wheel_radius: float
    slope_up: float
    slope_down: float
    slope_across: float
    step_forward: float
    step_backward: float
    ditch_forward: float
    ditch_backward: float
    slope_torque: float
    step_torque: float
    why: dict[str, str]


def limits_of(rover: Rover, *, friction: float, torque: float | None = None, gravity: float = GRAVITY["earth"]) -> ClimbLimits:
    """Compute the steepest slopes, the highest step and the widest ditch of a rover.

    Args:
        rover: with masses; its sides must mirror each other.
        friction: coefficient of friction between wheels and terrain, 0 or more.
        torque: largest torque of a hub motor, N m, above 0; inf for no limit. Default: the least of the rover's `wheel_torque`,
            which is inf where it is not known.
        gravity: m/s², from 0.001 to 100 (`GRAVITY`).

    Returns:
        The limits. A size of 0 means that even the smallest obstacle fails.

    Raises:
        RockerbogieError: a number out of its range.
        RoverError: a rover without mass, or whose sides differ.
    """
    check_arguments(rover, friction, torque, gravity)
    forward, backward = planar_rover(rover, False), planar_rover(rover, True)
    unit = 0.5 * forward.mass * gravity * forward.size
    limit = motor_limit(rover, torque) / unit
    found: dict[str, float] = {}
    why: dict[str, str] = {}
    found["slope_up"], why["slope_up"] = _steepest(lambda angle: _slope_verdict(forward, angle, friction, limit))
    found["slope_down"], why["slope_down"] = _steepest(lambda angle: _slope_verdict(backward, angle, friction, limit))
    found["slope_across"], why["slope_across"] = _steepest(lambda angle: _across_verdict(rover, angle, friction))
    smallest = SMALLEST * min(forward.radius)
    for kind in ("step", "ditch"):
        for direction in ("forward", "backward"):

            def fails(size: float, kind: str = kind, back: bool = direction == "backward") -> str:
                obstacle = obstacles.step(size) if kind == "step" else obstacles.ditch(size, forward.size)
                return _failure(rover, obstacle, back, friction, limit)

            name = f"{kind}_{direction}"
            found[name], why[name] = _largest(fails, smallest, LARGEST * forward.size)
    a, b = _on_slope(forward, np.array([found["slope_up"]]))
    slope_torque = least_torque(a, b, np.array(forward.radius) / forward.size, friction * (1.0 + ROUNDING) + ROUNDING)[0][0]
    high = max(("step_forward", "step_backward"), key=found.__getitem__)
    step_torque = 0.0
    if found[high] > 0.0:
        run = run_over(rover, obstacles.step(found[high]), high == "step_backward", COARSE)
        a, b = (part[run.uphill] for part in station_balance(run))
        step_torque = least_torque(a, b, np.array(run.rover.radius) / run.rover.size, friction * (1.0 + ROUNDING) + ROUNDING)[
            0
        ].max()
    return ClimbLimits(
        rover=rover.name, friction=float(friction), torque_limit=motor_limit(rover, torque),
        gravity=float(gravity), wheel_radius=float(rover.wheel_radius.max()), slope_torque=float(slope_torque) * unit,
        step_torque=float(step_torque) * unit, why=why, **found,
    )  # fmt: skip


def _failure(rover: Rover, obstacle: Profile, backward: bool, friction: float, torque: float) -> str:
    """Return why a rover does not get over an obstacle; "" if it does."""
    run = run_over(rover, obstacle, backward, COARSE)
    a, b = station_balance(run)
    needed = np.zeros(len(a))
    if np.isfinite(torque):
        up, radius = run.uphill, np.array(run.rover.radius) / run.rover.size
        needed[up] = least_torque(a[up], b[up], radius, friction * (1.0 + ROUNDING) + ROUNDING)[0]
    return first_failure(run, least_friction(a, b)[0], needed, friction, torque)[0]


def step_friction(rover: Rover, heights: ArrayLike, direction: Direction = "forward") -> tuple[Array, list[str]]:
    """Return the friction that steps need, and why steps that no friction overcomes fail.

    Args:
        rover: with masses; its sides must mirror each other.
        heights: (n,) m, increasing.
        direction: "forward" or "backward".

    Returns:
        Friction coefficient (n,), NaN from the first height that fails with any friction; its reason from there on, "" before.
    """
    at = np.asarray(heights, dtype=float)
    needed, why = np.full(at.size, np.nan), [""] * at.size
    for i, height in enumerate(at):
        run = run_over(rover, obstacles.step(float(height)), direction == "backward", COARSE)
        required = least_friction(*station_balance(run))[0]
        reason, _ = first_failure(run, required, np.zeros(required.size), np.inf, np.inf)
        if reason:
            why[i:] = [reason] * (at.size - i)
            break
        needed[i] = required[run.uphill].max(initial=0.0)
    return needed, why


def _largest(fails: Callable[[float], str], smallest: float, largest: float) -> tuple[float, str]:
    """Return the largest size before the first failure, and why the next one fails.

    Args:
        fails: reason for which a size fails; "" if it does not.
        smallest, largest: range, m.

    Returns:
        Size, m, to the relative error `TIGHT`; 0 if the smallest fails. The reason, or "size" if the largest does not fail.
    """
    good, size, reason = 0.0, smallest, ""
    while not reason and good < largest:
        size = min(size, largest)
        reason = fails(size)
        if not reason:
            good, size = size, size * GROWTH
    if not reason:
        return good, "size"
    bad = size
    while bad - good > TIGHT * bad and good > 0.0:
        size = 0.5 * (good + bad)
        now = fails(size)
        good, bad, reason = (size, bad, reason) if not now else (good, size, now)
    return good, reason


def _steepest(verdict: Callable[[Array], list[str]]) -> tuple[float, str]:
    """Return the steepest slope before the first failure, rad, and why the next one fails.

    Args:
        verdict: for angles (n,), the reasons for which they fail; "" where they do not.
    """
    low, high, reason = 0.0, 0.5 * np.pi - 1e-3, ""
    while high - low > ANGLE:
        angle = np.linspace(low, high, SWEEP)
        reasons = verdict(angle)
        bad = [k for k, why in enumerate(reasons) if why]
        if not bad:
            return high, "size"
        if bad[0] == 0:
            return 0.0, reasons[0]
        low, high, reason = float(angle[bad[0] - 1]), float(angle[bad[0]]), reasons[bad[0]]
    return low, reason


def _on_slope(plane: PlanarRover, angle: Array) -> tuple[Array, Array]:
    """Return the balance on slopes that rise along the direction of travel.

    Args:
        plane: the rover at rest.
        angle: (n,) rad.

    Returns:
        A (n, 4, 6), b (n, 4).
    """
    turn = np.exp(1j * angle)
    size, mass = plane.size, plane.mass
    at = np.array(plane.hub) - 1j * np.array(plane.radius)
    points = turn[:, None] * at / size
    normals = np.repeat(1j * turn[:, None], 3, axis=1)
    weights = (
        (turn * plane.upper / size, plane.upper_mass / mass),
        (turn * plane.bogie / size, plane.bogie_mass / mass),
    )
    return balance(points, normals, turn * plane.bogie_pivot / size, weights)


def _slope_verdict(plane: PlanarRover, angle: Array, friction: float, torque: float) -> list[str]:
    """Return why slopes (n,) fail; "" where they do not."""
    a, b = _on_slope(plane, angle)
    required = least_friction(a, b)[0]
    radius = np.array(plane.radius) / plane.size
    needed = least_torque(a, b, radius, friction * (1.0 + ROUNDING) + ROUNDING)[0] if np.isfinite(torque) else np.zeros(len(a))
    return [
        "tip_over" if not np.isfinite(r) else "friction" if r > friction * (1 + ROUNDING) + ROUNDING
        else "torque" if t > torque * (1 + ROUNDING) else ""
        for r, t in zip(required, needed, strict=True)
    ]  # fmt: skip


def _across_verdict(rover: Rover, angle: Array, friction: float) -> list[str]:
    """Return why cross slopes (n,) fail; "" where they do not.

    The rover stands on a plane; gravity is turned to either side by an acceleration that is added to it.
    """
    g = GRAVITY["earth"]
    size = 2.0 * float(np.abs(rover.hubs).max() + rover.wheel_radius.max() + rover.wheel_width.max())
    pose = settle(rover, surfaces.plane(size=2.0 * size, spacing=size / 8.0), np.zeros(angle.size), 0.0, 0.0)
    required = np.zeros(angle.size)
    for side in (1.0, -1.0):
        turned = g * np.stack([0.0 * angle, side * np.sin(angle), np.cos(angle) - 1.0], axis=-1)
        required = np.maximum(required, wheel_loads(pose, gravity=g, acceleration=turned).required_friction)
    for k in range(angle.size - 1, -1, -1):  # a slope without a solution needs at most what the next steeper one does
        if np.isnan(required[k]):
            required[k] = required[k + 1] if k + 1 < angle.size else np.inf
    return ["tip_over" if not np.isfinite(r) else "friction" if r > friction * (1 + ROUNDING) + 1e-6 else "" for r in required]
