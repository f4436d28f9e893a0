"""Equilibria in MuJoCo with x, y and yaw held: an independent reference for settled poses.

The base has three joints only (up, pitch, roll), wheels are braked and contacts have no friction, so that the rover
ends at a minimum of its potential energy. One `DropTower` serves many poses over one terrain: a Terrain or solid geoms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from rockerbogie import Rover, Terrain, wheel_frames
from rockerbogie.rover.frames import ON_BOGIE, WHEEL_SIDE
from rockerbogie.simulation.height_field import add_terrain, default_cell, terrain_contact
from rockerbogie.simulation.mjcf import add_mechanism, empty_spec

SHAPES = {
    "plane": mujoco.mjtGeom.mjGEOM_PLANE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    "mesh": mujoco.mjtGeom.mjGEOM_MESH,
}
JOINTS = ("z", "pitch", "roll", "rocker_left", "rocker_right", "bogie_left", "bogie_right")
STOPPED = ("rocker_left", "bogie_left", "bogie_right")
TIMESTEP = 0.004
#: Contacts without friction may be stiffer than those of a drive: they yield by about 1e-6 m.
SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)
#: Damping of each joint over its own inertia, 1/s: a bogie whose wheels are off the ground does not oscillate.
DAMPING = 8.0
#: Height above the terrain at which the rover is released, m; number of steps over which motion is averaged.
CLEAR, BLOCK = 0.003, 10
#: While the rover is lowered, damping is SLOWLY times greater, so that it does not pass an equilibrium. This ends when no
#: joint's mean changes by more than CALM (rad, m) between blocks, or after LONG steps.
SLOWLY, CALM, LONG = 5.0, 2e-5, 1500
SKY = 1e3  # m: height at which the rays that find the terrain start
#: A wheel with less than this share of the weight is off the ground.
LIFTED = 1e-6


@dataclass(frozen=True)
class Rest:
    """One equilibrium: means over the last `BLOCK` steps, SI units and radians."""

    z: float
    roll: float
    pitch: float
    rocker: float
    bogie: np.ndarray  # (2,)
    force: np.ndarray  # (6,) sum of each wheel's normal contact forces, N
    body_force: float  # the same of the body's box, N
    on_stop: np.ndarray  # (3,) True if the left rocker, left bogie or right bogie is at its limit
    residual: float  # largest change of a joint between the last two blocks, rad or m
    steps: int
    weight: float  # N

    @property
    def lifted(self) -> np.ndarray:
        """True (6,) where a wheel is off the ground."""
        return self.force < LIFTED * self.weight

    @property
    def at_rest(self) -> bool:
        """True if the rover has stopped and is upright."""
        return self.residual < 1e-5 and abs(self.roll) < np.pi / 2 and abs(self.pitch) < np.pi / 2


class DropTower:
    """A MuJoCo model of a rover above a terrain.

    `ground` is a Terrain, which becomes a height field with cells of `cell` m (default `default_cell`), or geoms, each a dict of
    `type` (plane, box, ellipsoid, mesh), `size`, `pos`, `quat`, `vertices`.
    """

    def __init__(self, rover: Rover, ground: Terrain | Sequence[Mapping[str, Any]], *, cell: float | None = None) -> None:
        spec = empty_spec(rover.name)
        spec.option.timestep = TIMESTEP
        if isinstance(ground, Terrain):
            add_terrain(spec, ground, None, cell or default_cell(rover, ground))
        else:
            for k, geom in enumerate(ground):
                given = {**geom, "type": SHAPES[geom["type"]]}
                if "vertices" in given:
                    spec.add_mesh(name=f"solid_{k}", uservert=np.ravel(given.pop("vertices")))
                    given["meshname"] = f"solid_{k}"
                spec.worldbody.add_geom(**given, **terrain_contact())
        base = spec.worldbody.add_body(name="body")
        base.add_joint(name="z", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        base.add_joint(name="pitch", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
        base.add_joint(name="roll", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[1, 0, 0])
        add_mechanism(spec, rover, base, friction=1.0, wheel_joints=False)
        touching = [f"wheel_{name}" for name in rover.wheel_names] + ["body"]
        for name in touching:
            spec.geom(name).condim, spec.geom(name).solimp = 1, SOLIMP
        self.rover = rover
        self.model = model = spec.compile()
        # MuJoCo's multiple contacts of a pair of shapes have wrong normals if a wheel's rim lies on an edge of a block
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, "mjDSBL_MULTICCD", 0))
        self.data = data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        self._damping = DAMPING * np.diag(inertia)
        self._joint = [int(model.joint(name).qposadr[0]) for name in JOINTS]
        self._stopped = np.array([model.joint(name).id for name in STOPPED])
        self._geoms = np.array([model.geom(name).id for name in touching])
        self._wheels = np.array([model.body(name).id for name in touching[:6]])
        self._base = model.body("body").id

    def drop(
        self,
        x: float,
        y: float,
        yaw: float,
        steering: Sequence[float] | None = None,
        *,
        start: Sequence[float] | None = None,
        tolerance: float = 1e-6,
        most_steps: int = 3000,
    ) -> Rest:
        """Lower the rover at (x, y, yaw) until it is at rest.

        It is at rest if no joint's mean changes by more than `tolerance` (rad, m) between blocks of steps. It starts level and
        above the terrain, or from `start` (z, roll, pitch, rocker, bogies), to test if it stays there.
        """
        model, data = self.model, self.data
        self._steer(steering)
        model.body_pos[self._base] = x, y, 0.0
        model.body_quat[self._base] = np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)
        mujoco.mj_resetData(model, data)
        mujoco.mj_kinematics(model, data)
        if start is None:
            data.qpos[self._joint[0]] = self._clear_height()
        else:
            z, roll, pitch, rocker, left, right = start
            data.qpos[self._joint] = z, pitch, roll, rocker, float(self.rover.right_rocker(rocker)), left, right
        slow = self._run(SLOWLY, CALM, LONG)[2] if start is None else 0
        mean, residual, steps = self._run(1.0, tolerance, most_steps)
        return self._rest(mean, residual, slow + steps)

    def _run(self, damping: float, tolerance: float, most_steps: int) -> tuple[np.ndarray, float, int]:
        """Return means over the last block of steps, their largest change, and the number of steps."""
        model, data = self.model, self.data
        model.dof_damping[:] = damping * self._damping
        mean, residual, steps = np.full(model.nq + 7, np.inf), np.inf, 0
        while residual > tolerance and steps < most_steps:
            total = np.zeros_like(mean)
            for _ in range(BLOCK):
                mujoco.mj_step(model, data)
                total += np.concatenate([data.qpos, self._support()])
            before, mean = mean, total / BLOCK
            residual = float(np.abs(mean - before)[: model.nq].max())
            steps += BLOCK
        return mean, residual, steps

    def _steer(self, steering: Sequence[float] | None) -> None:
        """Turn the braked wheels about their steering axes, by the positions of their bodies."""
        T = wheel_frames(self.rover, 0.0, (0.0, 0.0), steering)
        parent_pivot = np.where(ON_BOGIE[:, None], self.rover.bogie_pivot[WHEEL_SIDE], self.rover.rocker_pivot[WHEEL_SIDE])
        half = np.zeros(6) if steering is None else np.asarray(steering, dtype=float) / 2
        self.model.body_pos[self._wheels] = T[:, :3, 3] - parent_pivot
        self.model.body_quat[self._wheels] = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=-1)

    def _clear_height(self) -> float:
        """Return the height at which the level body and wheels are CLEAR m above the terrain."""
        data, rover = self.data, self.rover
        points = []
        for i, body in enumerate(self._wheels):
            r, half = rover.wheel_radius[i], rover.wheel_width[i] / 2
            u, v = (a.ravel() for a in np.meshgrid(np.linspace(-r, r, 13), np.linspace(-half, half, 5 if half else 1)))
            points.append(
                data.xpos[body]
                + np.stack([u, v, -np.sqrt(np.maximum(r**2 - u**2, 0))], axis=-1) @ data.xmat[body].reshape(3, 3).T
            )
        low, high = rover.body_box
        corner = np.stack(np.meshgrid(np.linspace(low[0], high[0], 7), np.linspace(low[1], high[1], 5), low[2]), axis=-1).reshape(
            -1, 3
        )
        points.append(data.xpos[self._base] + corner @ data.xmat[self._base].reshape(3, 3).T)
        p = np.concatenate(points)
        return float((self._ground_height(p) - p[:, 2]).max()) + CLEAR

    def _ground_height(self, p: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the terrain under points (n, 3), by rays from above, m."""
        ground_only = np.array([0, 1, 0, 0, 0, 0], dtype=np.uint8)
        hit, down = np.zeros(1, dtype=np.int32), np.array([0.0, 0.0, -1.0])
        far = np.array(
            [mujoco.mj_ray(self.model, self.data, np.array([x, y, SKY]), down, ground_only, 1, -1, hit) for x, y, _ in p]
        )
        return np.where(far < 0, -np.inf, SKY - far)

    def _support(self) -> np.ndarray:
        """Return the sums of normal forces (7,) on each wheel and the body's box at this step, N."""
        contact = self.data.contact
        touches = (np.reshape(contact.geom, (-1, 2))[:, None, :] == self._geoms[:, None]).any(axis=-1)
        return self.data.efc_force[contact.efc_address] @ touches

    def _rest(self, mean: np.ndarray, residual: float, steps: int) -> Rest:
        data = self.data
        pushing = data.efc_force > 0
        limited = data.efc_id[(data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT) & pushing]
        q = dict(zip(JOINTS, mean[self._joint].tolist(), strict=True))
        return Rest(
            z=q["z"], roll=q["roll"], pitch=q["pitch"], rocker=q["rocker_left"],
            bogie=np.array([q["bogie_left"], q["bogie_right"]]),
            force=mean[-7:-1], body_force=float(mean[-1]), on_stop=np.isin(self._stopped, limited),
            residual=residual, steps=steps, weight=self.rover.mass * 9.81,
        )  # fmt: skip
