"""MuJoCo model of a rover, with or without a terrain.

Names in the model, for a wheel named LF: bodies `body`, `rocker_left`, `rocker_right`, `bogie_left`, `bogie_right`,
`wheel_LF`; joints `free`, `rocker_left`, `rocker_right`, `bogie_left`, `bogie_right`, `steer_LF` (wheels that steer), `wheel_LF`;
actuators `steer_LF` (angle, rad) and `wheel_LF` (rate, rad/s); equality `differential`; geoms with contact `wheel_LF`,
`body` and `terrain`; keyframe `settled` (with a terrain).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import expect
from ..rover.differential import quartic
from ..rover.formats.mjcf_write import exact_text
from ..rover.frames import ON_BOGIE, WHEEL_SIDE
from ..rover.model import LOAD_ROVER, Link, Rover
from ..settling.pose import Pose
from ..settling.settle import settle
from ..terrain.heightfield import Terrain
from .height_field import Region, add_terrain, default_cell
from .motors import GRAVITY, add_motors

Array = NDArray[np.float64]

SIDES = ("left", "right")
#: Half the width of a disc (width 0) in wheel radii. It becomes an ellipsoid of revolution. On terrain tilted by α across the
#: axle, that is 0.005 r tan²α higher than the disc (0.02 mm for the paper's wheel and a roll of 10 deg).
DISC_HALF_WIDTH = 0.1
#: Contacts: time constant (s) and damping ratio; impedance d. At rest a contact is (1 - d) / d · g · (0.01 s)² = 0.11 mm deep,
#: the same under all wheels and for every mass. Stiffer contacts make a wheel that slides sideways chatter.
SOLREF = (0.01, 1.0)
SOLIMP = (0.9, 0.9, 0.001, 0.5, 2.0)
#: Stiffness of friction over that of the contact along its normal. MuJoCo's friction is a function of the sliding velocity, so
#: a loaded wheel creeps; the creep is inversely proportional to this number (docs/simulation.md).
FRICTION_STIFFNESS = 100.0
#: Impedance of the differential and the joint limits: their error is below 0.001 deg.
JOINT_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
#: Mass of a link without mass, as a share of the rover's: MuJoCo cannot move a body without mass.
LEAST_MASS_SHARE = 1e-4
TIMESTEP = 0.005  # s
#: Height above the terrain at which an exported rover starts with its joints at 0, m.
START_GAP = 0.01


def to_mjcf(
    rover: Rover,
    terrain: Terrain | None = None,
    *,
    region: Region | None = None,
    cell: float | None = None,
    friction: float = 0.8,
    torque: ArrayLike | None = None,
) -> str:
    """Write the rover, with or without a terrain, as MJCF text.

    Lengths, angles and masses of the mechanism are exact. Rockers and bogies are hinges with the rover's joint limits, the
    differential is a joint equality. A wheel is a cylinder of its width; with width 0 it is a thin ellipsoid that touches
    within 0.0005 radii of the disc. Each hub has a geared rate servo with a torque limit, each steering axis an angle servo
    (docs/simulation.md).

    Args:
        rover: the mechanism.
        terrain: becomes the height field `terrain`, its heights in the text itself. The rover starts in the middle of it, just
            above the terrain, with its joints at 0; the keyframe `settled` holds its settled pose. None: no terrain.
        region: (xmin, ymin, xmax, ymax) of the terrain to take, m. Default: all of it.
        cell: distance between nodes of the height field, m. Default: small enough for its triangles to fit the curved cells.
        friction: coefficient of sliding friction between wheels and terrain.
        torque: torque limit of the hub motors, a number or (6,), N·m. Default: `motors.TORQUE_SHARE` m g r.

    Returns:
        MJCF text.

    Raises:
        RoverError: a differential above the fourth power, MuJoCo's highest, that no quartic fits between the joint limits.
        TerrainError: a region without data.
        RockerbogieError: a torque that is not above 0.
    """
    spec = build_spec(rover, terrain, region=region, cell=cell, friction=friction, torque=torque)
    if terrain is not None:
        xmin, ymin, xmax, ymax = region or terrain.bounds
        _add_start(spec, rover, settle(rover, terrain, (xmin + xmax) / 2, (ymin + ymax) / 2))
    return exact_text(spec)


def build_spec(
    rover: Rover,
    terrain: Terrain | None = None,
    *,
    region: Region | None = None,
    cell: float | None = None,
    friction: float = 0.8,
    torque: ArrayLike | None = None,
) -> Any:
    """Build the model that `to_mjcf` writes, to be extended and compiled at full precision.

    Args:
        rover, terrain, region, cell, friction, torque: as for `to_mjcf`.

    Returns:
        `mujoco.MjSpec`.

    Raises:
        RoverError, TerrainError, RockerbogieError: as for `to_mjcf`.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    spec = empty_spec(rover.name)
    if terrain is not None:
        add_terrain(spec, terrain, region, default_cell(rover, terrain, region) if cell is None else cell)
    base = spec.worldbody.add_body(name="body")
    base.add_freejoint(name="free")
    add_mechanism(spec, rover, base, friction=friction)
    add_motors(spec, rover, torque)
    return spec


def empty_spec(name: str) -> Any:
    """Build an empty world with this package's solver, contact and light settings.

    Args:
        name: name of the model.

    Returns:
        `mujoco.MjSpec`.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    spec.compiler.balanceinertia = True
    spec.option.gravity = [0, 0, -GRAVITY]
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = FRICTION_STIFFNESS
    spec.option.ccd_tolerance = 1e-9  # less accurate contacts between a wheel and small triangles give it impulses
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 720
    spec.worldbody.add_light(pos=[0, 0, 10], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    return spec


def add_mechanism(spec: Any, rover: Rover, base: Any, *, friction: float, wheel_joints: bool = True) -> None:
    """Add rockers, bogies, wheels and the differential to a body.

    Args:
        spec: `mujoco.MjSpec`; it is changed.
        rover: the mechanism.
        base: the rover's body in `spec`. The caller adds its joints.
        friction: coefficient of sliding friction between wheels and terrain.
        wheel_joints: False fixes the wheels, braked and straight.
    """
    import mujoco

    hinge = mujoco.mjtJoint.mjJNT_HINGE
    _set_inertia(rover, base, rover.body, np.zeros(3))
    low, high = rover.body_box
    base.add_geom(
        name="body",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=(low + high) / 2,
        size=(high - low) / 2,
        rgba=[0.85, 0.8, 0.7, 1],
        **_contact(friction),
    )
    rockers, bogies = [], []
    for s, side in enumerate(SIDES):
        rocker = base.add_body(name=f"rocker_{side}", pos=rover.rocker_pivot[s])
        _add_hinge(rocker, f"rocker_{side}", rover.rocker_limits if s == 0 else None)
        _set_inertia(rover, rocker, rover.rockers[s], rover.rocker_pivot[s])
        bogie = rocker.add_body(name=f"bogie_{side}", pos=rover.bogie_pivot[s] - rover.rocker_pivot[s])
        _add_hinge(bogie, f"bogie_{side}", rover.bogie_limits)
        _set_inertia(rover, bogie, rover.bogies[s], rover.bogie_pivot[s])
        _add_arm(rover, rocker, rover.rocker_pivot[s], (rover.hubs[s], rover.bogie_pivot[s]))
        _add_arm(rover, bogie, rover.bogie_pivot[s], (rover.hubs[2 + s], rover.hubs[4 + s]))
        rockers.append(rocker)
        bogies.append(bogie)
    _add_differential(spec, rover)
    for i, name in enumerate(rover.wheel_names):
        s = WHEEL_SIDE[i]
        parent, origin = (bogies[s], rover.bogie_pivot[s]) if ON_BOGIE[i] else (rockers[s], rover.rocker_pivot[s])
        wheel = parent.add_body(name=f"wheel_{name}", pos=rover.hubs[i] - origin)
        if wheel_joints and rover.steers[i]:
            wheel.add_joint(name=f"steer_{name}", type=hinge, axis=[0, 0, 1], pos=[*rover.steering_offset[i], 0.0])
        if wheel_joints:
            wheel.add_joint(name=f"wheel_{name}", type=hinge, axis=[0, 1, 0])
        _set_inertia(rover, wheel, rover.wheels[i], rover.hubs[i])
        _add_tread(rover, wheel, i, friction)


def _contact(friction: float) -> dict[str, Any]:
    """Return geom attributes of rover parts that collide with the terrain only.

    Args:
        friction: coefficient of sliding friction.

    Returns:
        Attributes for `add_geom`.
    """
    return {
        "contype": 0,
        "conaffinity": 1,
        "condim": 3,
        "friction": [friction, 0.005, 0.0001],
        "solref": SOLREF,
        "solimp": SOLIMP,
    }


def _add_hinge(body: Any, name: str, limits: Array | None) -> None:
    """Add a hinge about y.

    Args:
        body: the body that turns.
        name: name of the joint.
        limits: (2,) rad. None: no limits.
    """
    import mujoco

    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    if limits is not None and np.isfinite(limits).any():
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.range = np.clip(limits, -4 * np.pi, 4 * np.pi)  # a side without a limit gets one that no linkage reaches
        joint.solref_limit, joint.solimp_limit = SOLREF, JOINT_SOLIMP


def _set_inertia(rover: Rover, body: Any, link: Link, origin: Array) -> None:
    """Set a body's mass, centre of mass and inertia.

    Args:
        rover: gives the smallest mass of a body.
        body: the body's specification; changed.
        link: mass and inertia; centre of mass in the rover's body frame.
        origin: (3,) the body's frame in the rover's body frame, m.
    """
    least = LEAST_MASS_SHARE * rover.mass
    inertia = link.inertia + np.eye(3) * (0.0 if link.mass >= least else least * rover.wheel_radius.min() ** 2)
    body.explicitinertial = True
    body.mass = max(link.mass, least)
    body.ipos = link.com - origin
    body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _add_tread(rover: Rover, body: Any, wheel: int, friction: float) -> None:
    """Add a wheel's geom.

    Args:
        rover: gives the wheel's size.
        body: the wheel's body.
        wheel: index of the wheel.
        friction: coefficient of sliding friction.
    """
    import mujoco

    r, width = float(rover.wheel_radius[wheel]), float(rover.wheel_width[wheel])
    if width > 0:
        shape = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": [r, width / 2, 0], "quat": [np.sqrt(0.5), np.sqrt(0.5), 0, 0]}
    else:
        shape = {"type": mujoco.mjtGeom.mjGEOM_ELLIPSOID, "size": [r, DISC_HALF_WIDTH * r, r]}
    body.add_geom(name=body.name, rgba=[0.25, 0.25, 0.27, 1], **shape, **_contact(friction))


def _add_arm(rover: Rover, body: Any, origin: Array, ends: tuple[Array, Array]) -> None:
    """Add capsules that show a link. They have no contact and no mass.

    Args:
        rover: gives the thickness.
        body: the link's body.
        origin: (3,) its frame in the rover's body frame, m.
        ends: (3,) points where the link ends, in the rover's body frame, m.
    """
    import mujoco

    thickness = 0.12 * float(rover.wheel_radius.min())
    for end in ends:
        if np.linalg.norm(end - origin) > thickness:
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, 0, 0, *(end - origin)], size=[thickness, 0, 0],
                rgba=[0.6, 0.6, 0.65, 1], contype=0, conaffinity=0, group=2,
            )  # fmt: skip


def _add_differential(spec: Any, rover: Rover) -> None:
    """Add the differential right = Σ cₖ leftᵏ as a joint equality.

    MuJoCo makes joint 1 (right) a quartic of joint 2 (left).

    Args:
        spec: `mujoco.MjSpec` that holds the rockers; it is changed.
        rover: gives the polynomial.
    """
    import mujoco

    c = np.trim_zeros(rover.differential, "b")
    if len(c) > 5:
        c = quartic(c, rover.rocker_limits)
    tie = spec.add_equality(
        name="differential",
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1="rocker_right",
        name2="rocker_left",
    )
    tie.data[: len(c)] = c
    tie.data[len(c) : 5] = 0.0
    tie.solref, tie.solimp = SOLREF, JOINT_SOLIMP


def _add_start(spec: Any, rover: Rover, pose: Pose) -> None:
    """Set where the rover starts, and add the keyframe `settled`.

    Args:
        spec: `mujoco.MjSpec` that holds the rover; it is changed, unless the pose is NaN.
        rover: the rover.
        pose: one settled pose. The rover starts with its attitude and its joints at 0, `START_GAP` above the terrain.
    """
    import mujoco

    if not np.isfinite(pose.q).all():
        return
    T, quaternion = pose.T_world_body, np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(T[:3, :3]).ravel())
    straight = Pose(rover, pose.terrain, pose.x, pose.y, pose.yaw, pose.steering, pose.q * (1, 1, 1, 0, 0, 0), pose.status)
    depth = float(np.nanmin([*straight.gap, straight.clearance]))
    body = spec.body("body")
    body.quat = quaternion
    body.pos = T[:3, 3] + (0.0, 0.0, START_GAP - depth)
    model = spec.compile()
    settled = model.qpos0.copy()
    settled[:3] = T[:3, 3]
    joints = {"rocker_left": pose.rocker, "rocker_right": rover.right_rocker(pose.rocker)}
    joints |= {f"bogie_{side}": angle for side, angle in zip(SIDES, pose.bogie, strict=True)}
    for name, angle in joints.items():
        settled[model.joint(name).qposadr[0]] = angle
    spec.add_key(name="settled", qpos=settled)
