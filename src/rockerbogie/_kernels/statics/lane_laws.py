"""Forces of LANES poses at once under the laws of linear equations (`laws`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from ..jit.raw_views import unowned_view
from ..jit.vectors import LANES, larger, on_lanes, root, smaller, where
from ..model.linkage import P_RADIUS
from .cone_scaling import Vector, Wheel, read
from .lane_algebra import solve_pivoted
from .lane_pose import load_poses, rover_mass
from .lane_problem import touches_belly
from .lane_rows import (
    BOGIE_LEFT,
    BOGIE_RIGHT,
    EQUATIONS,
    LAW,
    LAW_ROWS,
    LINK,
    OX,
    OY,
    OZ,
    ROCKER_RATE,
    VX,
    VY,
    VZ,
    WHEEL,
)

Array = NDArray[np.float64]

LIGHT = 1e-9  # of the weight: a wheel with less normal force uses no friction
PIVOT = 1e-10  # smallest pivot, of the largest entry: below it a system is singular


def _weight(rows: Any) -> list[Any]:
    """Return the generalized force to balance, of the weight.

    Args:
        rows: rows of the lane array (`lane_rows`).
    """
    g = _three(rows, LAW.field)
    pull, centre = _three(rows, LINK.forward) * rows[LAW.pull], _three(rows, LINK.centre)
    b: list[Any] = [None] * (EQUATIONS - 1)
    for k, at in ((BOGIE_LEFT, LINK.bogie_left), (BOGIE_RIGHT, LINK.bogie_right), (ROCKER_RATE, LINK.rocker)):
        b[k] = -g.dot(_three(rows, at))
    b[VX], b[VY], b[VZ] = (pull - g).parts
    b[OX], b[OY], b[OZ] = g.cross(centre).parts
    return b


def _three(rows: Any, at: int) -> Vector:
    """Return three consecutive rows as a vector.

    Args:
        rows: rows of the lane array.
        at: the first row.
    """
    return Vector(rows[at], rows[at + 1], rows[at + 2])


def _column(wheel: Wheel, force: Vector) -> list[Any]:
    """Return the generalized force of a contact force.

    Args:
        wheel: contact.
        force: N.
    """
    column: list[Any] = [force.x * 0.0] * (EQUATIONS - 1)
    for k, part in wheel.generalized(force):
        column[k] = part
    return column


def _vertical(rows: Any) -> None:
    """Compute contact forces that are parallel to gravity.

    They balance across gravity and about it by themselves; the six other equations are found by projection.

    Args:
        rows: rows of the lane array (`lane_rows`).
    """
    up, b = _three(rows, LAW.field) * -1.0, _weight(rows)
    # two directions across gravity: the moments about them, the force along gravity and the three joints are left
    flat = (up.x < 0.7) & (up.x > -0.7)
    zero = up.x * 0.0
    p = Vector(where(flat, zero, -up.z), where(flat, up.z, zero), where(flat, -up.y, up.x))
    p = p * (1.0 / root(p.dot(p)))
    q = up.cross(p)

    def project(column: list[Any]) -> list[Any]:
        """Return the six equations of a generalized force.

        Args:
            column: (9,) generalized force.
        """
        force, moment = Vector(*column[VX : VZ + 1]), Vector(*column[OX : OZ + 1])
        return [column[BOGIE_LEFT], column[BOGIE_RIGHT], column[ROCKER_RATE], up.dot(force), p.dot(moment), q.dot(moment)]

    wheels = [Wheel(rows, i, False) for i in range(6)]
    columns = [project(_column(wheel, up)) for wheel in wheels]
    size, solved = solve_pivoted([[columns[i][k] for i in range(6)] for k in range(6)], project(b), PIVOT)
    _report(rows, wheels, [up * x for x in size], solved)


def _equal_torque(rows: Any, rover: Any) -> None:
    """Compute contact forces of equal axle torques, with sides as of six equal lateral springs.

    Args:
        rows: rows of the lane array (`lane_rows`).
        rover: the packed rover.
    """
    forward, first = _three(rows, LINK.forward), rover[P_RADIUS]
    wheels = [Wheel(rows, i, False) for i in range(6)]
    headings = [read(rows, WHEEL.heading, i) for i in range(6)]
    sides = [wheel.n.cross(t) for wheel, t in zip(wheels, headings, strict=True)]
    shares = [first / rover[P_RADIUS + i] for i in range(6)]
    ahead = [forward.dot(wheel.p) for wheel in wheels]
    zero: list[Any] = [forward.x * 0.0] * (EQUATIONS - 1)
    columns, torque, spring, turn = [], zero, zero, zero
    for i, wheel in enumerate(wheels):
        columns.append(_column(wheel, wheel.n))
        side = _column(wheel, sides[i])
        torque = [x + y * shares[i] for x, y in zip(torque, _column(wheel, headings[i]), strict=True)]
        spring = [x + y for x, y in zip(spring, side, strict=True)]
        turn = [x + y * ahead[i] for x, y in zip(turn, side, strict=True)]
    columns += [torque, spring, turn]
    x, solved = solve_pivoted([[columns[i][k] for i in range(9)] for k in range(9)], _weight(rows), PIVOT)
    forces = [
        wheel.n * x[i] + headings[i] * (x[6] * shares[i]) + sides[i] * (x[7] + x[8] * ahead[i]) for i, wheel in enumerate(wheels)
    ]
    _report(rows, wheels, forces, solved)


def _report(rows: Any, wheels: list[Wheel], forces: list[Vector], solved: Any) -> None:
    """Set the results of a law.

    Args:
        rows: rows of the lane array; the results of LAW are filled.
        wheels: contacts.
        forces: contact forces, of the weight.
        solved: flags: the forces are determined.
    """
    zero = forces[0].x * 0.0
    used, least = zero, zero + math.inf
    for wheel, force in zip(wheels, forces, strict=True):
        i, t = wheel.i, read(rows, WHEEL.heading, wheel.i)
        n, along, side = wheel.n.dot(force), t.dot(force), wheel.n.cross(t).dot(force)
        used = larger(used, where(n > LIGHT, root(along * along + side * side) / n, 0.0))
        least = smaller(least, n)
        rows[LAW.force + i], rows[LAW.force + 6 + i], rows[LAW.force + 12 + i] = n, along, side
        rows[LAW.torque + i] = read(rows, WHEEL.turn, i).dot(force)
    rows[LAW.used], rows[LAW.least], rows[LAW.solved] = used, least, where(solved, zero + 1.0, zero)


vertical = on_lanes(_vertical)
equal_torque = on_lanes(_equal_torque, numbers=True)


@owning_njit
def law_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, stops: NDArray[np.int8],
    belly_point: Array, field: Array, drawbar: Array, torques: bool, pull: float,
    force: Array, torque: Array, required: Array, status: NDArray[np.uint8], codes: tuple[int, int, int, int],
    first: int, last: int,
) -> None:  # fmt: skip
    """Fill the contact forces of each pose under the vertical or the equal-torque law.

    Args:
        rover, yaw, steering, q, point, normal, stops, belly_point, field, drawbar: as for `loads.loads_batch`.
        torques: True: equal torques; False: forces parallel to gravity.
        pull: least normal force that does not pull, of the weight.
        force, torque, required: filled as by `loads.loads_batch` where the forces balance.
        status: (n,) filled.
        codes: status of a pose that balances, of no pose, of a wheel that pulls, and of forces that are not determined.
        first, last: range of poses.
    """
    balanced, no_pose, pulls, undetermined = codes
    block, mass, shared = np.zeros(LAW_ROWS * LANES), rover_mass(rover), field.shape[0] == 1
    lanes = unowned_view(block)
    for start in range(first, last, LANES):
        count = min(LANES, last - start)
        load_poses(lanes, rover, yaw, steering, q, point, normal, stops, start, count, start == first)
        for l in range(LANES):
            k = start + min(l, count - 1)
            row = 0 if shared else k
            gx, gy, gz = field[row, 0], field[row, 1], field[row, 2]
            g = math.sqrt(gx * gx + gy * gy + gz * gz)
            lanes[LAW.field * LANES + l], lanes[(LAW.field + 1) * LANES + l] = gx / g, gy / g
            lanes[(LAW.field + 2) * LANES + l] = gz / g
            lanes[LAW.pull * LANES + l] = drawbar[k if drawbar.shape[0] > 1 else 0] / (mass * g)
        if torques:
            equal_torque(lanes, rover)
        else:
            vertical(lanes)
        for l in range(count):
            k = start + l
            limits = lanes[LINK.stop * LANES + l] + lanes[(LINK.stop + 1) * LANES + l] + lanes[(LINK.stop + 2) * LANES + l]
            determined = lanes[LINK.contacts * LANES + l] == 6.0 and limits == 0.0 and lanes[LAW.solved * LANES + l] == 1.0
            if lanes[LINK.contacts * LANES + l] == 0.0:
                status[k] = no_pose
            elif not determined or touches_belly(belly_point[k if belly_point.shape[0] > 1 else 0]):
                status[k] = undetermined
            else:
                status[k] = balanced if lanes[LAW.least * LANES + l] >= pull else pulls
            if status[k] != balanced:
                continue
            row = 0 if shared else k
            weight = mass * math.sqrt(field[row, 0] ** 2 + field[row, 1] ** 2 + field[row, 2] ** 2)
            moment = weight * lanes[LINK.reach * LANES + l]
            for i in range(6):
                for c in range(3):
                    force[k, i, c] = lanes[(LAW.force + 6 * c + i) * LANES + l] * weight
                torque[k, i] = lanes[(LAW.torque + i) * LANES + l] * moment
            required[k] = lanes[LAW.used * LANES + l]
    block[0] = 0.0  # keep the owner alive: `lanes` is an unowned view of it
