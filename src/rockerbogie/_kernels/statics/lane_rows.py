"""Layout of the lane array of the primal-dual method.

Row r holds one number for each of LANES poses, at `lanes[r * LANES + lane]`. Each group of rows is a NamedTuple: in its class,
the value after a field is its number of rows; in its instance, the value is its first row. Vectors of six wheels take 18 rows:
x of all wheels, then y, then z.

Generalized velocities and forces have the order BOGIE_LEFT ... BOUND here; moments are divided by the reach.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

BOGIE_LEFT, BOGIE_RIGHT, ROCKER_RATE, VX, VY, VZ, OX, OY, OZ, BOUND = range(10)
EQUATIONS = 10  # nine of the balance, then the bound of the sum of normal forces
BALANCE = (VX, VY, VZ, OX, OY, OZ, ROCKER_RATE, BOGIE_LEFT, BOGIE_RIGHT)  # row of each equation of `balance`
LIMITS = (ROCKER_RATE, BOGIE_LEFT, BOGIE_RIGHT, BOUND)  # equation of each force that cannot be negative

Rows = TypeVar("Rows", bound=tuple[int, ...])


class WheelRows(NamedTuple):
    """Contacts of six wheels."""

    normal: int = 18  # unit normal
    point: int = 18  # contact point from the body's origin, over the reach
    rocker: int = 18  # velocity of the point at unit rate of the left rocker
    bogie: int = 18  # velocity of the point at unit rate of its bogie
    on: int = 6  # 1; 0 for a wheel off the ground


class ProblemRows(NamedTuple):
    """Problem of each lane."""

    b: int = EQUATIONS  # generalized force to balance
    e: int = EQUATIONS  # derivative of the balance by `theta` or `mu`; in the friction problem each step fills it
    sign: int = 4  # direction of the forces LIMITS
    limit: int = 4  # 1 where the force exists, else 0
    cones: int = 1  # number of cones
    free: int = 1  # 1: the objective counts; 0: the step goes to the central point of power `target`
    target: int = 1  # power of each cone, force times velocity


class StateRows(NamedTuple):
    """Forces and virtual motion of each lane."""

    force: int = 18  # contact force
    speed: int = 18  # contact velocity; that of the motion v once the residual is 0
    v: int = EQUATIONS  # virtual motion
    y: int = 4  # forces LIMITS
    w: int = 4  # velocities against them
    theta: int = 1  # tangent of gravity's turn
    mu: int = 1  # friction coefficient
    price: int = 1  # multiplier of mu >= 0


class ResultRows(NamedTuple):
    """Results of a step."""

    gap: int = 1  # power of all forces before the step
    short: int = 1  # largest residual of the balance before the step
    bowed: int = 1  # curvature by `mu` or `theta`; not above 0: the path is lost
    alpha: int = 1  # share of the step taken
    proof: int = EQUATIONS  # motion that costs the contacts least for its work on b
    force: int = 18  # contact forces corrected to balance, as `balance_step` fills them
    y: int = 4  # forces LIMITS likewise


def _place(kind: type[Rows], start: int) -> tuple[Rows, int]:
    """Place the rows of a group one after another.

    Args:
        kind: class of the group.
        start: its first row.

    Returns:
        The group, and the number after its last row.
    """
    starts = [start]
    for size in kind._field_defaults.values():  # type: ignore[attr-defined]
        starts.append(starts[-1] + size)
    return kind(*starts[:-1]), starts[-1]  # type: ignore[arg-type]


WHEEL, _end = _place(WheelRows, 0)
PROBLEM, _end = _place(ProblemRows, _end)
STATE, STATE_END = _place(StateRows, _end)
RESULT, ROWS = _place(ResultRows, STATE_END)
