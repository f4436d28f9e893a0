"""The rover let down in MuJoCo with x, y, yaw held: an outside truth for settled poses.

The base has three joints only (up, pitch, roll), the wheels are braked, contacts have no friction: where it comes to rest is where
its masses lie lowest. One `DropTower` serves many poses over one ground, which is a Terrain or a list of solid geoms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from rockerbogie import Rover, Terrain, wheel_frames
from rockerbogie.frames import ON_BOGIE, WHEEL_SIDE
from rockerbogie.mjcf import add_mechanism, add_terrain, default_cell, empty_spec, ground_contact

SHAPES = {"plane": mujoco.mjtGeom.mjGEOM_PLANE, "box": mujoco.mjtGeom.mjGEOM_BOX, "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID}
JOINTS = ("z", "pitch", "roll", "rocker_left", "rocker_right", "bogie_left", "bogie_right")
TIMESTEP = 0.004
BLOCK = 10
#: Damping of each joint over its own inertia, 1/s: about what stops a hanging bogie without swinging.
DAMPING = 12.0
#: Let down from this far above the ground, m.
CLEAR = 0.003
SKY = 1e3


@dataclass(frozen=True)
class Rest:
    """One pose at rest. SI and radians; `force` (6,) is each wheel's support along the contact normals, N."""

    z: float
    roll: float
    pitch: float
    rocker: float
    bogie: np.ndarray  # (2,)
    force: np.ndarray  # (6,)
    body_force: float  # of the body's box on the ground, N
    on_stop: np.ndarray  # (3,) rocker, left bogie, right bogie
    residual: float  # greatest joint speed left, rad/s or m/s
    steps: int
    contacts: int  # most that any wheel has: 50 means some were dropped

    @property
    def lifted(self) -> np.ndarray:
        """(6,) true where a wheel carries nothing."""
        return self.force <= 1e-9 * (self.force.sum() + self.body_force)


@dataclass
class DropTower:
    """Ground with a rover above it. `ground`: a Terrain, or geoms {"type": "plane"|"box"|"ellipsoid", "size", "pos", "quat"}."""

    rover: Rover
    ground: Terrain | Sequence[Mapping[str, Any]]
    cell: float | None = None
    model: Any = field(init=False)
    data: Any = field(init=False)

    def __post_init__(self) -> None:
        spec = empty_spec(self.rover.name)
        spec.option.timestep = TIMESTEP
        if isinstance(self.ground, Terrain):
            add_terrain(spec, self.ground, None, self.cell or default_cell(self.rover, self.ground))
        else:
            for geom in self.ground:
                more = {key: value for key, value in geom.items() if key != "type"}
                spec.worldbody.add_geom(type=SHAPES[geom["type"]], **more, **ground_contact())
        base = spec.worldbody.add_body(name="body")
        base.add_joint(name="z", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        base.add_joint(name="pitch", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
        base.add_joint(name="roll", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[1, 0, 0])
        add_mechanism(spec, self.rover, base, friction=1.0, wheel_joints=False)
        for geom in spec.geoms:
            if geom.contype == 0 and geom.conaffinity == 1:
                geom.condim = 1
        self.model = model = spec.compile()
        self.data = data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        model.dof_damping[:] = DAMPING * np.diag(inertia)
        self._dof = [model.joint(name).dofadr[0] for name in JOINTS]
        self._wheel_geom = np.array([model.geom(f"wheel_{name}").id for name in self.rover.wheel_names])
        self._geoms = np.append(self._wheel_geom, model.geom("body").id)
        self._wheel_body = np.array([model.body(f"wheel_{name}").id for name in self.rover.wheel_names])
        self._wheel_quat = model.body_quat[self._wheel_body].copy()

    def drop(
        self,
        x: float,
        y: float,
        yaw: float,
        steering: Sequence[float] | None = None,
        *,
        tolerance: float = 1e-6,
        most_steps: int = 2500,
    ) -> Rest:
        """Let down at (x, y, yaw) until no joint moves faster than `tolerance` (rad/s, m/s) for ten steps on end."""
        model, data, base = self.model, self.data, self.model.body("body").id
        self._steer(steering)
        model.body_pos[base] = x, y, 0.0
        model.body_quat[base] = np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)
        mujoco.mj_resetData(model, data)
        mujoco.mj_kinematics(model, data)
        data.qpos[self._dof[0]] = self._clear_height()
        steps, last, rest = 0, np.inf, None
        while steps < most_steps:
            sums = np.zeros(model.nv + 7)
            for _ in range(BLOCK):
                mujoco.mj_step(model, data)
                sums[: model.nv] += data.qpos
                sums[model.nv :] += self._support()
            steps += BLOCK
            mean, before = sums / BLOCK, last
            last = mean
            if np.abs(mean - before)[: model.nv].max() < tolerance:
                break
        return self._read(last, np.abs(mean - before)[: model.nv].max(), steps)

    def _steer(self, steering: Sequence[float] | None) -> None:
        T = wheel_frames(self.rover, 0.0, (0.0, 0.0), steering)
        knee = np.where(ON_BOGIE[:, None], self.rover.bogie_pivot[WHEEL_SIDE], self.rover.rocker_pivot[WHEEL_SIDE])
        self.model.body_pos[self._wheel_body] = T[:, :3, 3] - knee
        half = np.zeros(6) if steering is None else np.asarray(steering) / 2
        self.model.body_quat[self._wheel_body] = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=-1)

    def _clear_height(self) -> float:
        """Body height at which level wheels, and the body's box, clear everything under their footprints."""
        data, rover = self.data, self.rover
        lift = -np.inf
        for i, geom in enumerate(self._wheel_geom):
            r, half = rover.wheel_radius[i], rover.wheel_width[i] / 2
            along, across = data.xmat[self._wheel_body[i]].reshape(3, 3)[:, :2].T
            u = np.linspace(-r, r, 13)
            for v in np.linspace(-half, half, 5 if half else 1):
                p = data.geom_xpos[geom] + np.outer(u, along) + v * across
                lift = max(lift, (self._heights(p) - (p[:, 2] - np.sqrt(np.maximum(r**2 - u**2, 0)))).max())
        low, high = rover.body_box
        corner = np.stack(
            np.meshgrid(np.linspace(low[0], high[0], 7), np.linspace(low[1], high[1], 5), [low[2]]), axis=-1
        ).reshape(-1, 3)
        p = corner @ data.xmat[self.model.body("body").id].reshape(3, 3).T + data.xpos[self.model.body("body").id]
        return float(max(lift, (self._heights(p) - p[:, 2]).max())) + CLEAR

    def _heights(self, p: np.ndarray) -> np.ndarray:
        """(n,) of the highest ground under points (n, 3), by rays from above."""
        ground_only = np.array([0, 1, 0, 0, 0, 0], dtype=np.uint8)
        hit = np.zeros(1, dtype=np.int32)
        down = np.array([0.0, 0.0, -1.0])
        far = [mujoco.mj_ray(self.model, self.data, np.array([x, y, SKY]), down, ground_only, 1, -1, hit) for x, y in p[:, :2]]
        return np.where(np.array(far) < 0, -np.inf, SKY - np.array(far))

    def _support(self) -> np.ndarray:
        """(7,) what carries each wheel and the body's box, N."""
        contact = self.data.contact
        pair = np.stack([contact.geom1, contact.geom2], axis=-1).reshape(-1, 2)
        return self.data.efc_force[contact.efc_address] @ (pair[:, None, :] == self._geoms[:, None]).any(-1)

    def _read(self, mean, residual, steps: int) -> Rest:
        model, data = self.model, self.data
        q = dict(zip(JOINTS, mean[self._dof], strict=True))
        stops = np.zeros(3, dtype=bool)
        limited = data.efc_id[data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT]
        for k, name in enumerate(("rocker_left", "bogie_left", "bogie_right")):
            stops[k] = model.joint(name).id in limited
        return Rest(
            z=q["z"], roll=q["roll"], pitch=q["pitch"], rocker=q["rocker_left"],
            bogie=np.array([q["bogie_left"], q["bogie_right"]]),
            force=mean[-7:-1], body_force=mean[-1], on_stop=stops,
            residual=residual, steps=steps, contacts=0,
        )  # fmt: skip
