"""The rover as a MuJoCo model: the same mechanism, the same ground, with masses, motors and friction.

Names in the model, for a wheel called LF: bodies `body`, `rocker_left`, `rocker_right`, `bogie_left`, `bogie_right`,
`wheel_LF`; joints `free`, `rocker_left`, `rocker_right`, `bogie_left`, `bogie_right`, `steer_LF` (wheels that steer), `wheel_LF`;
actuators `steer_LF` (position, rad) and `wheel_LF` (speed, rad/s); equality `differential`; colliding geoms `wheel_LF`,
`body` and `terrain`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import TerrainError, expect
from ..rover.differential import quartic
from ..rover.formats.mjcf_write import exact_text
from ..rover.frames import ON_BOGIE, WHEEL_SIDE
from ..rover.model import LOAD_ROVER, Link, Rover
from ..settling.settle import settle
from ..terrain.heightfield import Terrain

Array = NDArray[np.float64]
Region = tuple[float, float, float, float]

SIDES = ("left", "right")
#: A disc (width 0) becomes an ellipsoid of revolution this many radii thick to either side: on ground tilted by α across the axle
#: it stands 0.005 r tan²α higher than the disc would (0.02 mm for the paper's wheel and a roll of 10 deg).
DISC_HALF_BREADTH = 0.1
#: Contacts: time constant (s), damping ratio; and impedance d. At rest they give way by (1 - d) / d · g · (0.01 s)² = 0.11 mm,
#: whatever the rover weighs, under all wheels alike. Stiffer ones make a wheel that is dragged sideways chatter.
SOLREF = (0.01, 1.0)
SOLIMP = (0.9, 0.9, 0.001, 0.5, 2.0)
#: The differential and the stops, which nothing drags over: they give way by less than 0.001 deg.
JOINT_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
#: The triangles under the wheels stay this close to the ground they stand for, m, as far as the coarsest cells below allow.
TRIANGLE_ERROR = 1e-4
#: Cells no finer than these shares of a wheel's radius and breadth: the first keeps a contact's dent well inside a cell, the
#: second keeps a wheel within the 50 contacts MuJoCo holds for a pair of geoms.
CELL_OF_RADIUS, CELL_OF_BREADTH = 1 / 10, 1 / 8
#: Most nodes of a height field.
MOST_NODES = 20_000_000
#: Links without mass get this share of the rover's: a simulator cannot move what has none.
LEAST_MASS_SHARE = 1e-4
TIMESTEP = 0.005  # s
#: Motors. Behind its gears each has the inertia of this share of the rover's mass at the wheel's rim, which is nothing at rover
#: speeds; a hub's servo makes up its rate within SERVO_TIME, a steering servo its angle within LAG_TIME, s.
ROTOR_SHARE, SERVO_TIME, LAG_TIME = 0.7, 0.02, 0.1


def to_mjcf(
    rover: Rover,
    terrain: Terrain | None = None,
    *,
    region: Region | None = None,
    cell: float | None = None,
    friction: float = 0.8,
) -> str:
    """The rover, and the ground if given, as MJCF text; the mechanism exact to the last digit.

    Rockers and bogies are hinges within the rover's stops, the differential a joint equality, masses and inertias the links' own.
    A wheel is a cylinder of its width, or for width 0 a thin ellipsoid that touches where the disc would within 0.0005 radii; its
    hub has a speed servo, its steering axis an angle servo (docs/simulation.md).

    Args:
        terrain: becomes the height field `terrain`, its heights in the text itself; the rover starts half a wheel's radius above
            its middle, if it can stand there. None leaves the rover alone in space.
        region: (xmin, ymin, xmax, ymax) of the ground to take, m. Default: all of it.
        cell: step of the height field, m. Default: fine enough for its triangles to follow the terrain's curved cells.
        friction: coefficient of sliding friction between wheels and ground.

    Raises:
        RoverError: a differential above the fourth power, MuJoCo's highest, that no quartic follows over the rocker's stops.
        TerrainError: no known ground in the region.
    """
    spec = build_spec(rover, terrain, region=region, cell=cell, friction=friction)
    if terrain is not None:
        xmin, ymin, xmax, ymax = region or terrain.bounds
        pose = settle(rover, terrain, (xmin + xmax) / 2, (ymin + ymax) / 2)
        if np.isfinite(pose.z):
            spec.body("body").pos = pose.x, pose.y, pose.z + rover.wheel_radius.max() / 2
    return exact_text(spec)


def build_spec(
    rover: Rover,
    terrain: Terrain | None = None,
    *,
    region: Region | None = None,
    cell: float | None = None,
    friction: float = 0.8,
) -> Any:
    """What `to_mjcf` writes, as a `mujoco.MjSpec` that can be added to and compiled at full precision."""
    expect(rover, Rover, "rover", LOAD_ROVER)
    spec = empty_spec(rover.name)
    if terrain is not None:
        add_terrain(spec, terrain, region, default_cell(rover, terrain, region) if cell is None else cell)
    base = spec.worldbody.add_body(name="body")
    base.add_freejoint(name="free")
    add_mechanism(spec, rover, base, friction=friction)
    _add_drives(spec, rover)
    return spec


def empty_spec(name: str) -> Any:
    """A world of ours with nothing in it: solver, contacts and light set."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    spec.compiler.balanceinertia = True
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.ccd_tolerance = 1e-9  # coarser contacts between a wheel and small triangles kick it
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 720
    spec.worldbody.add_light(pos=[0, 0, 10], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    return spec


def add_mechanism(spec: Any, rover: Rover, base: Any, *, friction: float, wheel_joints: bool = True) -> None:
    """Hang the rover on `base`, a body whose joints are the caller's.

    Without `wheel_joints` the wheels are fixed where they stand, braked and straight.
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


def add_terrain(spec: Any, terrain: Terrain, region: Region | None, cell: float) -> None:
    """Lay the ground as the height field `terrain`, its nodes `cell` apart or a little closer."""
    import mujoco

    x, y, z = sample_ground(terrain, region, cell)
    low, rise = float(z.min()), max(float(np.ptp(z)), 1e-3)
    spec.add_hfield(
        name="terrain", nrow=len(y), ncol=len(x), size=[np.ptp(x) / 2, np.ptp(y) / 2, rise, 0.1],
        userdata=((z - low) / rise).ravel(),
    )  # fmt: skip
    spec.worldbody.add_geom(
        name="terrain", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="terrain",
        pos=[(x[0] + x[-1]) / 2, (y[0] + y[-1]) / 2, low], rgba=[0.7, 0.45, 0.3, 1], **ground_contact(),
    )  # fmt: skip


def sample_ground(terrain: Terrain, region: Region | None, cell: float) -> tuple[Array, Array, Array]:
    """x (cols,), y (rows,) and heights (rows, cols), unknown ones from their nearest known.

    Nodes fall on the terrain's own, so that a linear ground keeps its creases: a whole number to each of its cells, or
    of its cells to each of theirs.
    """
    low_x, low_y, high_x, high_y = region or terrain.bounds
    x, y = _nodes(terrain.x, low_x, high_x, cell), _nodes(terrain.y, low_y, high_y, cell)
    if len(x) * len(y) > MOST_NODES:
        raise TerrainError(
            f"ground {terrain.name!r} takes {len(x)} x {len(y)} nodes {x[1] - x[0]:.3g} m apart to simulate, more than "
            f"{MOST_NODES:,}: take a smaller region or a shorter path"
        )
    z = terrain.height(*np.meshgrid(x, y))
    unknown = np.isnan(z)
    if unknown.all():
        raise TerrainError(
            f"ground {terrain.name!r} is all unknown (nan) in the region {region or terrain.bounds}: choose another place"
        )
    if unknown.any():
        from scipy.ndimage import distance_transform_edt

        z = z[tuple(distance_transform_edt(unknown, return_distances=False, return_indices=True))]
    return x, y, z


def default_cell(rover: Rover, terrain: Terrain, region: Region | None = None) -> float:
    """As fine as `TRIANGLE_ERROR` asks, as coarse as the wheels need."""
    coarsest = max(CELL_OF_RADIUS * float(rover.wheel_radius.min()), CELL_OF_BREADTH * float(rover.wheel_width.max()))
    step = min(terrain.spacing)
    if step <= coarsest:
        return coarsest
    _, _, z = sample_ground(terrain, region, step / 2)
    middle, corners = z[1:-1:2, 1:-1:2], (z[:-2:2, :-2:2], z[2::2, 2::2], z[:-2:2, 2::2], z[2::2, :-2:2])
    error = max(float(np.abs(middle - (a + b) / 2).max()) for a, b in (corners[:2], corners[2:]))
    divisions = max(np.sqrt(error / TRIANGLE_ERROR), 1.0)  # a triangle's error falls with the square of its cell
    return float(max(step / divisions, coarsest))


def _nodes(own: Array, low: float, high: float, cell: float) -> Array:
    """Evenly spaced nodes over [low, high], cut to the terrain's own along this axis."""
    step = own[1] - own[0]
    first = max(int(np.floor((low - own[0]) / step + 1e-9)), 0)
    last = min(int(np.ceil((high - own[0]) / step - 1e-9)), len(own) - 1)
    if first >= last:
        raise TerrainError(
            f"the region from {low:g} to {high:g} m does not lie on the ground, which spans {own[0]:g} to {own[-1]:g} m"
        )
    if cell > step:
        stride = min(round(cell / step), last - first)
        return own[first : last + 1 : stride]
    return np.linspace(own[first], own[last], (last - first) * int(np.ceil(step / cell - 1e-9)) + 1)


def _contact(friction: float) -> dict[str, Any]:
    """Parts of the rover touch the ground and not one another."""
    return {
        "contype": 0,
        "conaffinity": 1,
        "condim": 3,
        "friction": [friction, 0.005, 0.0001],
        "solref": SOLREF,
        "solimp": SOLIMP,
    }


def ground_contact() -> dict[str, Any]:
    """Ground touches the rover alone, and takes the rover's friction and stiffness."""
    return {"contype": 1, "conaffinity": 0, "priority": -1, "group": 1}


def _add_hinge(body: Any, name: str, limits: Array | None) -> None:
    import mujoco

    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    if limits is not None and np.isfinite(limits).any():
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.range = np.clip(limits, -4 * np.pi, 4 * np.pi)  # an open side is one no linkage reaches
        joint.solref_limit, joint.solimp_limit = SOLREF, JOINT_SOLIMP


def _set_inertia(rover: Rover, body: Any, link: Link, origin: Array) -> None:
    least = LEAST_MASS_SHARE * rover.mass
    inertia = link.inertia + np.eye(3) * (0.0 if link.mass >= least else least * rover.wheel_radius.min() ** 2)
    body.explicitinertial = True
    body.mass = max(link.mass, least)
    body.ipos = link.com - origin
    body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _add_tread(rover: Rover, body: Any, wheel: int, friction: float) -> None:
    import mujoco

    r, width = float(rover.wheel_radius[wheel]), float(rover.wheel_width[wheel])
    if width > 0:
        shape = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": [r, width / 2, 0], "quat": [np.sqrt(0.5), np.sqrt(0.5), 0, 0]}
    else:
        shape = {"type": mujoco.mjtGeom.mjGEOM_ELLIPSOID, "size": [r, DISC_HALF_BREADTH * r, r]}
    body.add_geom(name=body.name, rgba=[0.25, 0.25, 0.27, 1], **shape, **_contact(friction))


def _add_arm(rover: Rover, body: Any, origin: Array, ends: tuple[Array, Array]) -> None:
    """Capsules to look at: they touch nothing and weigh nothing."""
    import mujoco

    thickness = 0.12 * float(rover.wheel_radius.min())
    for end in ends:
        if np.linalg.norm(end - origin) > thickness:
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, 0, 0, *(end - origin)], size=[thickness, 0, 0],
                rgba=[0.6, 0.6, 0.65, 1], contype=0, conaffinity=0, group=2,
            )  # fmt: skip


def _add_differential(spec: Any, rover: Rover) -> None:
    """right = Σ cₖ leftᵏ: MuJoCo's joint equality makes joint 1 (right) a quartic of joint 2 (left)."""
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


def _add_drives(spec: Any, rover: Rover) -> None:
    """In each hub a speed servo, soft enough that six wheels share the work; on each steering axis one that holds its angle."""
    import mujoco

    rotor = ROTOR_SHARE * rover.mass * float(rover.wheel_radius.max()) ** 2  # kg m²
    stiffness = rotor / SERVO_TIME  # Nm s/rad
    for joint in spec.joints:
        if joint.name.startswith(("wheel_", "steer_")):
            joint.armature = rotor
    for i, name in enumerate(rover.wheel_names):
        drive = spec.add_actuator(name=f"wheel_{name}", target=f"wheel_{name}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_velocity(kv=stiffness)
        if rover.steers[i]:
            steer = spec.add_actuator(name=f"steer_{name}", target=f"steer_{name}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
            steer.set_to_position(kp=stiffness / LAG_TIME, kv=stiffness)
