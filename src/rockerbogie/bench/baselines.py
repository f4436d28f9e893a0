"""Baselines for settling and Jacobians, timed in the same run: fsolve, MuJoCo, Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import cycle
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import threads
from ..rover.formats import to_urdf
from ..rover.model import Rover
from ..simulation.height_field import add_terrain, default_cell
from ..simulation.mjcf import add_mechanism, empty_spec
from ..terrain.heightfield import Terrain
from .cases import Case
from .clock import each
from .paper.baseline import RIM_POINTS, Contact, fsolve_settle

Array = NDArray[np.float64]
NAN = float("nan")

#: Lowering in MuJoCo: time step, s; stiffness of the frictionless contacts; damping of each joint over its inertia, 1/s;
#: clearance at the start, m. The rover is at rest when no joint moves by more than STILL (m, rad) in BLOCK steps.
TIMESTEP, SOLIMP, DAMPING, CLEAR = 0.004, (0.99, 0.999, 0.001, 0.5, 2.0), 8.0, 0.003
STILL, BLOCK, MOST_BLOCKS = 1e-6, 10, 300


@dataclass(frozen=True)
class Baseline:
    """Another method to settle: medians over the poses that it solves (failures have no time)."""

    seconds: float
    solved: float  # share of the poses
    gap: float  # m: worst of six gaps of its poses, over the true terrain


def fsolve_baseline(case: Case, x: Array, y: Array, yaw: Array, contact: Contact, points: int = RIM_POINTS) -> Baseline:
    """Time the paper's method on one thread, with wheels of width 0.

    Args:
        case: rover and terrain.
        x: (n,) m.
        y: (n,) m.
        yaw: (n,) rad.
        contact: as `fsolve_settle`.
        points: as `fsolve_settle`.

    Returns:
        Median CPU time, share of poses solved, and median of the worst of six gaps.
    """
    discs = case.rover.replace(wheel_width=np.zeros(6))
    spent, gaps = [], []
    with threads(1):
        for place in zip(x, y, yaw, strict=True):
            start = process_time()
            pose = fsolve_settle(discs, case.terrain, *place, contact=contact, points=points)
            if int(pose.status) == 0:
                spent.append(process_time() - start)
                gaps.append(float(np.abs(pose.gap).max()))
    return Baseline(_median(spent), len(spent) / len(x), _median(gaps))


def drop_baseline(case: Case, x: Array, y: Array, yaw: Array) -> Baseline:
    """Time MuJoCo lowering the rover to equilibrium.

    x, y and yaw are fixed: the body has joints for z, pitch and roll only. Wheels are cylinders that do not turn, contacts
    have no friction, and joints are damped. Only simulation steps are timed, not the construction of the model. The result
    is another pose than that of `settle`, so it has no gaps.

    Args:
        case: rover and terrain.
        x: (n,) m.
        y: (n,) m.
        yaw: (n,) rad.

    Returns:
        Median CPU time and share of poses that come to rest; gap NaN.
    """
    spent = [_drop(case.rover, case.terrain, *place) for place in zip(x, y, yaw, strict=True)]
    done = [seconds for seconds in spent if np.isfinite(seconds)]
    return Baseline(_median(done), len(done) / len(x), NAN)


def _median(spent: list[float]) -> float:
    """Return the median of some times, or NaN of none."""
    return float(np.median(spent)) if spent else NAN


def _drop(rover: Rover, terrain: Terrain, x: float, y: float, yaw: float) -> float:
    """Return the CPU time of one rover coming to rest in MuJoCo, s; NaN if it does not."""
    import mujoco

    reach = float(np.abs(rover.hubs[:, :2]).sum(axis=1).max() + rover.wheel_radius.max() + rover.wheel_width.max())
    region = (x - reach, y - reach, x + reach, y + reach)
    spec = empty_spec(rover.name)
    spec.option.timestep = TIMESTEP
    add_terrain(spec, terrain, region, default_cell(rover, terrain, region))
    base = spec.worldbody.add_body(name="body", pos=[x, y, 0.0], quat=[np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis in (("z", slide, [0, 0, 1]), ("pitch", hinge, [0, 1, 0]), ("roll", hinge, [1, 0, 0])):
        base.add_joint(name=name, type=kind, axis=axis)
    add_mechanism(spec, rover, base, friction=1.0, wheel_joints=False)
    for name in (*(f"wheel_{wheel}" for wheel in rover.wheel_names), "body"):
        spec.geom(name).condim, spec.geom(name).solimp = 1, SOLIMP
    model: Any = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    model.dof_damping[:] = DAMPING * np.diag(inertia)
    data.qpos[model.joint("z").qposadr[0]] = _height(rover, terrain, x, y, yaw) + CLEAR
    start = process_time()
    for _ in range(MOST_BLOCKS):
        before = data.qpos.copy()
        mujoco.mj_step(model, data, nstep=BLOCK)
        if np.abs(data.qpos - before).max() < STILL:
            return process_time() - start
    return NAN


def _height(rover: Rover, terrain: Terrain, x: float, y: float, yaw: float) -> float:
    """Return the z at which a body with all angles 0 is just above the terrain, m."""
    low = []
    for hub, r, width in zip(rover.hubs, rover.wheel_radius, rover.wheel_width, strict=True):
        u, v = (a.ravel() for a in np.meshgrid(np.linspace(-r, r, 25), np.linspace(-width / 2, width / 2, 5)))
        low.append(hub + np.stack([u, v, -np.sqrt(np.maximum(r**2 - u**2, 0.0))], axis=-1))
    (x0, y0, z0), (x1, y1, _) = rover.body_box
    low.append(np.stack(np.meshgrid(np.linspace(x0, x1, 15), np.linspace(y0, y1, 15), z0), axis=-1).reshape(-1, 3))
    p = np.concatenate(low)
    c, s = np.cos(yaw), np.sin(yaw)
    return float(np.nanmax(terrain.height(x + c * p[:, 0] - s * p[:, 1], y + s * p[:, 0] + c * p[:, 1]) - p[:, 2]))


def pinocchio_seconds(rover: Rover, calls: int = 200, repeats: int = 50) -> tuple[float, float] | None:
    """Time Pinocchio's frames and six wheel Jacobians per configuration.

    Pinocchio has no call for a batch. The overhead of its Python calls is measured by the same calls on a model without
    joints; for the Jacobian of a frame, which needs a joint, on a model with one joint.

    Args:
        rover: exported to URDF for Pinocchio.
        calls: configurations per measurement.
        repeats: number of measurements, of which the fastest counts.

    Returns:
        Seconds per configuration without the overhead, and with it; None if Pinocchio is not installed.
    """
    try:
        import pinocchio as pin  # type: ignore[import-untyped]
    except ImportError:
        return None
    model, none, one = pin.buildModelFromXML(to_urdf(rover)), pin.Model(), pin.Model()
    one.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hinge")
    tip = one.addFrame(pin.Frame("tip", 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    data, no_data, one_data = model.createData(), none.createData(), one.createData()
    wheels = [model.getFrameId(f"wheel_{name}") for name in rover.wheel_names]
    rng = np.random.default_rng(3)
    q = cycle([pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)) for _ in range(calls)])
    q_none = np.zeros(0)
    pin.computeJointJacobians(one, one_data, rng.normal(size=1))
    pin.updateFramePlacements(one, one_data)

    def whole() -> None:
        pin.computeJointJacobians(model, data, next(q))
        pin.updateFramePlacements(model, data)
        for wheel in wheels:
            pin.getFrameJacobian(model, data, wheel, pin.LOCAL)

    def empty() -> None:
        pin.computeJointJacobians(none, no_data, q_none)
        pin.updateFramePlacements(none, no_data)
        for _ in wheels:
            pin.getFrameJacobian(one, one_data, tip, pin.LOCAL)

    called = each(whole, calls, repeats)
    return called - each(empty, calls, repeats), called
