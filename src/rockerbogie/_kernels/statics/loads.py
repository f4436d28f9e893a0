"""Contact forces of a batch of poses."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, owning_njit
from ..jit.raw_views import unowned_view
from ..model.ground import META_X, META_Y, META_Z, Ground, surface
from ..model.linkage import P_BOX, P_HALF, PITCH, ROLL, Z, body_axes, forward_kinematics, set_hub_offsets
from ..model.wheel import AX, AY, AZ, HX, HY, HZ
from ..search.body_box import box_over_ground
from ..search.box_points import N_GAP, N_GX, N_GY, N_X, N_Y, N_Z, NEAR_SIZE
from .balance import EQUATIONS, axle_torque
from .friction_path import HELD, UNHELD
from .lane_friction import UNSOLVED, friction_batch
from .lane_laws import law_batch
from .lane_problem import has_lines
from .lane_tipping import SOLVED, margin_batch
from .lane_widening import widen_batch
from .laws import equal_slip, frictionless_sides, parallel_forces
from .least_friction import least_friction, lower_bound
from .mechanism import BELLY, EXTRA, ON_BELLY, assemble, gravity_column, new_mechanism
from .tipping import force_angle, hold_margin, set_corners

Array = NDArray[np.float64]

LEAST_FRICTION, EQUAL_TORQUE, EQUAL_SLIP, FRICTIONLESS_SIDES, VERTICAL = range(5)
# What became of each pose
BALANCED, NO_POSE, NOT_HELD, PULLS, UNDETERMINED, NOT_CONVERGED = range(6)
PROVED = 1e-6  # largest gap between the least friction found, or 1, and its proved bound, of it
PULL = -1e-9  # of the weight: a normal force below it pulls
TOUCHING = 1e-6  # m: gap of a belly contact
FLUSH = 1e-8  # m: largest difference of the gaps along a contact line


@owning_njit
def belly_batch(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, q: Array, wanted: NDArray[np.bool_],
    point: Array, normal: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Fill the contacts of the body's box with the terrain.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) m, m, rad.
        q: (n, 6) poses.
        wanted: (n,) True where the box may be in contact.
        point: (n, BELLY, 3) filled with contact points from the body's origin, m; NaN where there is none.
        normal: (n, BELLY, 3) filled with unit normals into the box.
        start, stop: range of poses.
    """
    axes, near = np.empty((3, 3)), np.empty((BELLY, NEAR_SIZE))
    meta = ground[2]
    for k in range(start, stop):
        point[k] = normal[k] = math.nan
        if not wanted[k] or math.isnan(q[k, Z]):
            continue
        body_axes(q[k, ROLL], q[k, PITCH], math.cos(yaw[k]), math.sin(yaw[k]), axes)
        box = rover[P_BOX : P_BOX + 6]
        px, py = x[k] - meta[META_X], y[k] - meta[META_Y]
        _, count = box_over_ground(ground, box, axes, px, py, q[k, Z] - meta[META_Z], TOUCHING, near)
        for j in range(count):
            if near[j, N_GAP] > TOUCHING:
                continue
            size = math.sqrt(1.0 + near[j, N_GX] ** 2 + near[j, N_GY] ** 2)
            point[k, j, 0], point[k, j, 1], point[k, j, 2] = near[j, N_X], near[j, N_Y], near[j, N_Z]
            normal[k, j, 0], normal[k, j, 1], normal[k, j, 2] = -near[j, N_GX] / size, -near[j, N_GY] / size, 1.0 / size


@owning_njit
def span_batch(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, q: Array, point: Array, span: Array,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Fill the lines along which wheels touch the terrain over their whole width.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) m, m, rad.
        steering: (n, 6) or (1, 6) rad.
        q: (n, 6) poses.
        point: (n, 6, 3) contact points from the body's origin, m; NaN where a wheel is off the ground.
            Points on lines are replaced by the middles.
        span: (n, 6, 3) filled with half of each line, along the axle, m; 0: the contact is a point.
        start, stop: range of poses.
    """
    m, grid, meta = new_mechanism(), ground[0], ground[2]
    for k in range(start, stop):
        span[k] = 0.0
        if math.isnan(q[k, Z]):
            continue
        m.q[:] = q[k]
        m.q[Z] -= meta[META_Z]
        set_hub_offsets(rover, steering[k if steering.shape[0] > 1 else 0], m.hub_offsets)
        px, py, c, s = x[k] - meta[META_X], y[k] - meta[META_Y], math.cos(yaw[k]), math.sin(yaw[k])
        if not forward_kinematics(rover, m.hub_offsets, px, py, c, s, m.q, m.axes, m.pivots, m.wheels):
            continue
        for i in range(6):
            w, half = m.wheels[i], rover[P_HALF + i]
            if half == 0.0 or math.isnan(point[k, i, 0]):
                continue
            cx, cy, cz = point[k, i, 0] + px, point[k, i, 1] + py, point[k, i, 2] + m.q[Z]
            along = (cx - w[HX]) * w[AX] + (cy - w[HY]) * w[AY] + (cz - w[HZ]) * w[AZ]
            gap, line = cz - surface(grid, meta, cx, cy)[0], True
            for end in (-half - along, half - along, -along):
                if not line:
                    break
                there = cz + end * w[AZ] - surface(grid, meta, cx + end * w[AX], cy + end * w[AY])[0]
                line = abs(there - gap) < FLUSH
            if line:
                span[k, i, 0], span[k, i, 1], span[k, i, 2] = half * w[AX], half * w[AY], half * w[AZ]
                point[k, i, 0] -= along * w[AX]
                point[k, i, 1] -= along * w[AY]
                point[k, i, 2] -= along * w[AZ]


@owning_njit
def loads_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array,
    stops: NDArray[np.int8], belly_point: Array, belly_normal: Array, field: Array, drawbar: Array, law: int, gap: float,
    force: Array, torque: Array, required: Array, bound: Array, limit: Array, belly: Array, status: NDArray[np.uint8],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Fill the contact forces that balance each pose under a law.

    Args:
        rover: (P_SIZE,) the packed rover.
        yaw: (n,) rad.
        steering: (n, 6) or (1, 6) rad.
        q: (n, 6) poses.
        point, normal: (n, 6, 3) contact points from the body's origin, m, NaN where a wheel is off the ground, and unit normals.
        span: (n, 6, 3) or (1, 6, 3) half of the line along which a wheel touches, about `point`, m; 0: the contact is a point.
        stops: (n, 3) -1 or 1 where rocker, left or right bogie is at its low or high limit, else 0.
        belly_point, belly_normal: (n, BELLY, 3) or (1, BELLY, 3) contacts of the body's box, NaN where there is none.
        field: (n, 3) or (1, 3) gravity less the rover's acceleration in world axes, m/s².
        drawbar: (n,) or (1,) force that pulls the body backward along its x axis at its origin, N.
        law: LEAST_FRICTION, EQUAL_TORQUE, EQUAL_SLIP, FRICTIONLESS_SIDES or VERTICAL.
        gap: power of all forces at which the search for the least friction ends: its error is about this.
        force: (n, 6, 3) filled with normal force, traction and side force, N; NaN without a balance.
        torque: (n, 6) filled with motor torques, N m, positive forward.
        required: (n,) filled with the friction coefficient that these forces use.
        bound: (n,) filled with the proved lower bound of the least friction coefficient; NaN under other laws.
        limit: (n, 3) filled with the torques that joint limits exert, N m.
        belly: (n,) filled with the normal force on the body, N.
        status: (n,) filled with BALANCED, NO_POSE, NOT_HELD, PULLS, UNDETERMINED or NOT_CONVERGED.
        start, stop: range of poses.
    """
    rover, yaw, steering, q = unowned_view(rover), unowned_view(yaw), unowned_view(steering), unowned_view(q)
    point, normal, span, stops = unowned_view(point), unowned_view(normal), unowned_view(span), unowned_view(stops)
    belly_point, belly_normal = unowned_view(belly_point), unowned_view(belly_normal)
    field, drawbar, force, torque = unowned_view(field), unowned_view(drawbar), unowned_view(force), unowned_view(torque)
    required, bound, limit = unowned_view(required), unowned_view(bound), unowned_view(limit)
    belly, status = unowned_view(belly), unowned_view(status)
    if law == VERTICAL or law == EQUAL_TORQUE:
        for k in range(start, stop):
            force[k] = torque[k] = limit[k] = required[k] = bound[k] = belly[k] = math.nan
        law_batch(
            rover, yaw, steering, q, point, normal, stops, belly_point, field, drawbar, law == EQUAL_TORQUE, PULL,
            force, torque, required, status, (BALANCED, NO_POSE, PULLS, UNDETERMINED), start, stop,
        )  # fmt: skip
        for k in range(start, stop):
            if status[k] == BALANCED:
                limit[k] = belly[k] = 0.0
        return
    m = new_mechanism()
    b, f, sizes = np.empty(EQUATIONS), np.zeros((6, 3)), np.zeros(6)
    y, v = np.zeros(EXTRA), np.zeros(EQUATIONS)
    if law == LEAST_FRICTION:
        friction_batch(
            rover, yaw, steering, q, point, normal, span, stops, belly_point, field, drawbar, gap,
            force, torque, required, bound, limit, belly, status, BALANCED, start, stop,
        )  # fmt: skip
        widen_batch(
            rover, yaw, steering, q, point, normal, span, stops, belly_point, field, drawbar, gap,
            force, torque, required, bound, limit, belly, status, BALANCED, NOT_HELD, start, stop,
        )  # fmt: skip
    for k in range(start, stop):
        if law == LEAST_FRICTION and status[k] != UNSOLVED:
            continue
        force[k] = torque[k] = limit[k] = math.nan
        required[k] = bound[k] = belly[k] = math.nan
        status[k] = NO_POSE
        at, field_at = k if belly_point.shape[0] > 1 else 0, k if field.shape[0] > 1 else 0
        count, more, reach = assemble(
            m, rover, yaw[k], steering[k if steering.shape[0] > 1 else 0], q[k], point[k], normal[k], stops[k],
            belly_point[at], belly_normal[at],
        )  # fmt: skip
        if count == 0:
            continue
        gx, gy, gz = field[field_at, 0], field[field_at, 1], field[field_at, 2]
        mass = gravity_column(m, rover, reach, gx, gy, gz, b)
        weight = mass * math.sqrt(gx * gx + gy * gy + gz * gz)
        pull = drawbar[k if drawbar.shape[0] > 1 else 0]
        for n in range(3):
            b[n] -= pull * m.axes[0, n]
        for n in range(EQUATIONS):
            b[n] /= -weight
        packed, packed_frame, extra = m.columns, m.frame, m.extra
        code = BALANCED
        if law == LEAST_FRICTION:
            mu, outcome, _ = least_friction(packed, count, extra, more, b, f, y, v)
            if outcome == HELD:
                bound[k] = lower_bound(packed, count, extra, more, b, mu, v)
                if not mu - bound[k] < PROVED * max(1.0, mu):
                    code = NOT_CONVERGED
            if outcome == UNHELD:
                code = NOT_HELD
                required[k] = math.inf
            elif outcome != HELD:
                code = NOT_CONVERGED
        elif more > 0 or (law != FRICTIONLESS_SIDES and count < 6):
            code = UNDETERMINED
        elif law == FRICTIONLESS_SIDES:
            code = BALANCED if frictionless_sides(packed, count, b, f) else UNDETERMINED
        elif not parallel_forces(packed, count, packed_frame, gx, gy, gz, b, sizes):
            code = UNDETERMINED
        else:
            for i in range(6):
                f[i, 0] = sizes[i] * upright(packed_frame[i, 0], gx, gy, gz)
            code = BALANCED if equal_slip(packed, m.forward, b, f) else NOT_CONVERGED
        if code == BALANCED:
            for i in range(count):
                if not f[i, 0] >= PULL:
                    code = PULLS
        status[k] = code
        if code != BALANCED:
            continue
        used = 0.0
        force[k] = torque[k] = limit[k] = belly[k] = 0.0
        for i in range(count):
            w = m.who[i]
            n, t, s = f[i, 0], f[i, 1], f[i, 2]
            if n > -PULL or law == LEAST_FRICTION:
                used = max(used, math.sqrt(t * t + s * s) / n)
            force[k, w, 0], force[k, w, 1], force[k, w, 2] = n * weight, t * weight, s * weight
            fx, fy, fz = 0.0, 0.0, 0.0
            for c in range(3):
                fx += force[k, w, c] * packed_frame[i, c, 0]
                fy += force[k, w, c] * packed_frame[i, c, 1]
                fz += force[k, w, c] * packed_frame[i, c, 2]
            torque[k, w] = axle_torque(m.wheels[w], point[k, w], fx, fy, fz)
        for j in range(more):
            if m.owner[j] != ON_BELLY:
                limit[k, m.owner[j]] = -1.0 * stops[k, m.owner[j]] * y[j] * weight * reach
            else:
                belly[k] += y[j] * weight
        required[k] = used
        if law == LEAST_FRICTION and not used - bound[k] < PROVED * max(1.0, used):
            force[k] = torque[k] = limit[k] = required[k] = bound[k] = belly[k] = math.nan
            status[k] = NOT_CONVERGED


@inlined
def upright(normal: Array, gx: float, gy: float, gz: float) -> float:
    """Return the part along a contact normal of a unit force against gravity.

    Args:
        normal: (3,) unit normal.
        gx, gy, gz: gravity less the acceleration, m/s².
    """
    return -(gx * normal[0] + gy * normal[1] + gz * normal[2]) / math.sqrt(gx * gx + gy * gy + gz * gz)


@owning_njit
def stability_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array,
    stops: NDArray[np.int8], belly_point: Array, belly_normal: Array, friction: float, tolerance: float,
    margin: Array, bound: Array, direction: Array, stays: NDArray[np.bool_], slides: NDArray[np.bool_], angle: Array,
    energy: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Fill the tip margins of each pose.

    Args:
        rover, yaw, steering, q, point, normal, span, stops, belly_point, belly_normal: as for `loads_batch`.
        friction: friction coefficient.
        tolerance: largest difference of the margin's bounds, rad.
        margin: (n,) filled with the hold margin, rad; NaN without a pose.
        bound: (n,) filled with the turn up to which forces hold the pose in every azimuth, rad; NaN where it is not known.
        direction: (n,) filled with the azimuth in which the centre of mass then moves, rad.
        stays: (n, 6) filled with True for wheels that stay in place in that motion.
        slides: (n,) filled with True if no contact stays in place.
        angle, energy: (n,) filled with the force-angle measure and the energy margin of the rover as one rigid body, both
            for a weight of 1 N: rad m, m; (0,): not wanted.
        start, stop: range of poses.
    """
    rover, yaw, steering, q = unowned_view(rover), unowned_view(yaw), unowned_view(steering), unowned_view(q)
    point, normal, span, stops = unowned_view(point), unowned_view(normal), unowned_view(span), unowned_view(stops)
    belly_point, belly_normal = unowned_view(belly_point), unowned_view(belly_normal)
    margin, bound, direction = unowned_view(margin), unowned_view(bound), unowned_view(direction)
    stays, slides, angle, energy = unowned_view(stays), unowned_view(slides), unowned_view(angle), unowned_view(energy)
    m, outcome = new_mechanism(), np.empty(margin.size, np.uint8)
    travel, way, status = np.empty((3, EQUATIONS)), np.empty(3), unowned_view(outcome)
    corner = np.empty((12, 3))
    for k in range(start, stop):
        margin[k] = bound[k] = direction[k] = math.nan
        stays[k] = slides[k] = False
        if angle.size > 0:
            angle[k] = energy[k] = math.nan
    margin_batch(
        rover, yaw, steering, q, point, normal, span, stops, belly_point, friction, tolerance,
        margin, bound, direction, stays, slides, angle, energy, status, start, stop,
    )  # fmt: skip
    for k in range(start, stop):
        if status[k] == SOLVED or has_lines(span, k):
            continue
        at = k if belly_point.shape[0] > 1 else 0
        count, more, reach = assemble(
            m, rover, yaw[k], steering[k if steering.shape[0] > 1 else 0], q[k], point[k], normal[k], stops[k],
            belly_point[at], belly_normal[at],
        )  # fmt: skip
        if count == 0:
            continue
        for c in range(3):
            mass = gravity_column(
                m, rover, reach, 1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 1.0 if c == 2 else 0.0, travel[c]
            )
            for n in range(EQUATIONS):
                travel[c, n] /= mass
        stays[k] = False
        margin[k], slides[k] = hold_margin(m, count, more, travel, friction, way, stays[k])
        direction[k] = math.nan
        if 0.0 < margin[k] < 0.5 * math.pi:
            direction[k] = math.atan2(way[1], way[0])
        # moments of a unit weight about the origin, (x, y, z) × (0, 0, 1) = (y, -x, 0), give the centre of mass but its height,
        # and those of a force along x give that: (x, y, z) × (1, 0, 0) = (0, z, -y)
        if angle.size > 0:
            cx, cy, cz = -travel[2, 4] * reach, travel[2, 3] * reach, travel[0, 4] * reach
            set_corners(point[k], span[k if span.shape[0] > 1 else 0], corner)
            angle[k], energy[k] = force_angle(corner, cx, cy, cz)
    outcome[:1] = 0  # keep the owner alive: `status` is an unowned view of it
