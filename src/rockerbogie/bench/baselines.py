"""Baselines for settling and Jacobians, timed in the same run: fsolve, MuJoCo, Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import cycle
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import threads
from ..paper.baseline import RIM_POINTS, Contact, fsolve_settle
from ..rover.formats import to_urdf
from ..rover.model import Rover
from ..simulation.height_field import add_terrain, default_cell
from ..simulation.mjcf import add_mechanism, empty_spec
from ..terrain.heightfield import Terrain
from .cases import Case
from .clock import each

Array = NDArray[np.float64]
NAN = float("nan")

#: A drop: its step, s; contacts without friction, stiff; damping of each joint over its own inertia, 1/s; lowered from so far
#: above the ground, m; at rest when no joint moves by STILL (m, rad) in BLOCK steps.
TIMESTEP, SOLIMP, DAMPING, CLEAR = 0.004, (0.99, 0.999, 0.001, 0.5, 2.0), 8.0, 0.003
STILL, BLOCK, MOST_BLOCKS = 1e-6, 10, 300


@dataclass(frozen=True)
class Baseline:
    """Another method to settle: medians over the poses it solves (a failure is not a time)."""

    seconds: float
    solved: float  # share of the places
    gap: float  # m, the worst of six, as the ground is: what its answers are wrong by


def fsolve_baseline(case: Case, x: Array, y: Array, yaw: Array, contact: Contact, points: int = RIM_POINTS) -> Baseline:
    """Time the paper's method on one thread, with wheels without width."""
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
    """Time MuJoCo lowering the rover to equilibrium, another pose, so without gaps.

    x, y and yaw are held (the body has joints up, pitch and roll alone), wheels are braked cylinders, contacts frictionless, and
    the steps alone are counted: not the building of the model.
    """
    spent = [_drop(case.rover, case.terrain, *place) for place in zip(x, y, yaw, strict=True)]
    done = [seconds for seconds in spent if np.isfinite(seconds)]
    return Baseline(_median(done), len(done) / len(x), NAN)


def _median(spent: list[float]) -> float:
    return float(np.median(spent)) if spent else NAN


def _drop(rover: Rover, terrain: Terrain, x: float, y: float, yaw: float) -> float:
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
    """Height of the level body at which its treads and belly clear the ground, m."""
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
    """Time Pinocchio's frames and six wheel Jacobians per configuration; None if not installed.

    First with what its calls from Python cost taken off (the same calls on a model without joints; for a frame's Jacobian,
    which takes no such model, with one joint), then as called from Python. It has no call that takes a batch.
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
