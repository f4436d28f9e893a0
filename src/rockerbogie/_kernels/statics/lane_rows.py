"""Layout of the lane array of the primal-dual method.

Row r holds one number for each of LANES poses, at `lanes[r * LANES + lane]`. Each group of rows is a NamedTuple: in its class,
the value after a field is its number of rows; in its instance, the value is its first row. Vectors of all contacts take VECTORS
rows: x of all contacts, then y, then z. Contacts 0 to 5 are those of the six wheels. Where a wheel touches along its whole width
and the block has room for CONTACTS, contacts i and i + 6 are the two ends of that line.

Generalized velocities and forces have the order BOGIE_LEFT ... BOUND here; moments are divided by the reach.
"""

from __future__ import annotations

from typing import NamedTuple

from ..jit.rows import place_rows

WHEELS, CONTACTS = 6, 12  # contacts of a pose: one a wheel, or both ends of a line
VECTORS = 3 * CONTACTS

BOGIE_LEFT, BOGIE_RIGHT, ROCKER_RATE, VX, VY, VZ, OX, OY, OZ, BOUND = range(10)
EQUATIONS = 10  # nine of the balance, then the bound of the sum of normal forces
BALANCE = (VX, VY, VZ, OX, OY, OZ, ROCKER_RATE, BOGIE_LEFT, BOGIE_RIGHT)  # row of each equation of `balance`
LIMITS = (ROCKER_RATE, BOGIE_LEFT, BOGIE_RIGHT, BOUND)  # equation of each force that cannot be negative


class LinkRows(NamedTuple):
    """Masses and joints of a pose; lengths over the reach."""

    forward: int = 3  # the body's x direction
    left: int = 3  # the body's y direction
    rate: int = 1  # derivative of the right rocker angle by the left one
    centre: int = 3  # centre of mass
    rocker: int = 3  # gravity's power at unit rate of the left rocker is the scalar product with this
    bogie_left: int = 3  # the same of the left bogie
    bogie_right: int = 3
    reach: int = 1  # the farthest contact's distance, m
    contacts: int = 1  # number of wheels in contact; 0 if there is no pose
    stop: int = 3  # 1 where rocker, left or right bogie is at its limit, else 0
    way: int = 3  # direction in which that limit pushes: 1 or -1, 0 without a limit


class WheelRows(NamedTuple):
    """Contacts of all wheels."""

    normal: int = VECTORS  # unit normal
    point: int = VECTORS  # contact point from the body's origin, over the reach
    rocker: int = VECTORS  # velocity of the point at unit rate of the left rocker
    bogie: int = VECTORS  # velocity of the point at unit rate of its bogie
    on: int = CONTACTS  # 1; 0 if there is no such contact
    heading: int = VECTORS  # unit vector along which the wheel rolls
    turn: int = VECTORS  # motor torque against a force is the scalar product with this, over the reach


class PoseRows(NamedTuple):
    """Pose as the linkage takes it; angles in rad, lengths in m."""

    yaw: int = 1
    roll: int = 1
    pitch: int = 1
    rocker: int = 2  # left, right
    rate: int = 1  # derivative of the right rocker angle by the left one
    bogie: int = 2
    hub: int = VECTORS  # hub from its pivot, in the frame of its link
    steer: int = 12  # cos of the steering angles of all wheels, then sin
    point: int = VECTORS  # contact point from the body's origin; 0 for a wheel off the ground


class LawRows(NamedTuple):
    """Forces of a law; of the weight."""

    field: int = 3  # direction of gravity less the rover's acceleration
    pull: int = 1  # drawbar pull
    b: int = EQUATIONS - 1  # generalized force to balance
    force: int = 18  # normal force of all wheels, then traction, side force
    torque: int = 6  # motor torques over the reach
    used: int = 1  # largest ratio of tangential to normal force
    least: int = 1  # least normal force
    solved: int = 1  # 1 if the law determines the forces, else 0


class ProblemRows(NamedTuple):
    """Problem of each lane."""

    b: int = EQUATIONS  # generalized force to balance
    e: int = EQUATIONS  # derivative of the balance by `theta` or `mu`; in the friction problem each step fills it
    sign: int = 4  # direction of the forces LIMITS
    limit: int = 4  # 1 where the force exists, else 0
    cones: int = 1  # number of cones
    free: int = 1  # 1: the objective counts; 0: the step goes to the central point of power `target`
    target: int = 1  # power of each cone, force times velocity


class RayRows(NamedTuple):
    """Ray of gravity's turn in one azimuth, and the bounds of its end."""

    x: int = 1  # the azimuth's direction
    y: int = 1
    far: int = 1  # tangent at which the ray ends
    px: int = 1  # velocity of the centre of mass in the virtual motion
    py: int = 1
    pz: int = 1
    size: int = 1  # horizontal part of it
    height: int = 1  # the half-plane is x px + y py <= height
    ahead: int = 1  # horizontal part along the ray
    gap: int = 1  # tangent at the half-plane less that of the forces found
    news: int = 1  # 1 if the bounds are worth a look
    start: int = 1  # tangent before the step
    sx: int = 1  # unit normal of the half-plane before the step
    sy: int = 1
    left: int = 1  # forces hold up to this far along the half-plane, to the left of its normal; 0 if they do not balance
    right: int = 1  # the same to the right
    store: int = 1  # CENTRAL or KEPT: where to store the state; NOT: nowhere
    load: int = 1  # CENTRAL or KEPT: the state from which a new ray starts; NOT: the ray goes on


class StateRows(NamedTuple):
    """Forces and virtual motion of each lane."""

    force: int = VECTORS  # contact force
    speed: int = VECTORS  # contact velocity; that of the motion v once the residual is 0
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
    force: int = VECTORS  # contact forces corrected to balance, as `balance_step` fills them
    y: int = 4  # forces LIMITS likewise


LINK, _end = place_rows(LinkRows, 0)
WHEEL, LOADED = place_rows(WheelRows, _end)
PROBLEM, _end = place_rows(ProblemRows, LOADED)
STATE, STATE_END = place_rows(StateRows, _end)
RESULT, _end = place_rows(ResultRows, STATE_END)
RAY, _end = place_rows(RayRows, _end)
CENTRAL_STATE, _end = place_rows(StateRows, _end)  # central point, from which rays start
KEPT_STATE, ROWS = place_rows(StateRows, _end)  # end of the first ray that has met the nearest half-plane
POSE, POSE_ROWS = place_rows(PoseRows, LOADED)
LAW, LAW_ROWS = place_rows(LawRows, POSE_ROWS)
