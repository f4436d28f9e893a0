"""The rover's MuJoCo model at work: put it somewhere, command its motors, read where everything is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..rotations import quaternion_angles
from ..rover.model import Rover
from ..settling.pose import Pose
from .mjcf import SIDES

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Joints of the suspension, in the order they are recorded.
HINGES = [f"{part}_{side}" for part in ("rocker", "bogie") for side in SIDES]


@dataclass(frozen=True)
class Record:
    """One instant; SI and radians, wheels in the paper's order."""

    time: float
    place: Array  # (7,) x, y, z and quaternion w, x, y, z of the body
    velocity: Array  # (6,) of the body: linear in the world, angular in its own frame
    hinge: Array  # (4,) HINGES
    hinge_rate: Array  # (4,)
    steering: Array  # (6,)
    wheel_angle: Array  # (6,)
    wheel_rate: Array  # (6,)
    wheel_motion: Array  # (6, 6) of each wheel in the world: velocity of its hub, angular velocity
    contact_normal: Array  # (6, 3)
    contact_point: Array  # (6, 3) where the greatest contact force of each wheel acts, world; nan in the air
    contact_force: Array  # (6,) sum of the forces along the contact normals
    body_force: float  # and of those on the body's box
    wheel_rate_command: Array  # (6,)
    steering_command: Array  # (6,)


class Rig:
    """A compiled model from `mjcf.build_spec` and its state; indices of everything by name, wheels in the paper's order."""

    def __init__(self, rover: Rover, model: Any) -> None:
        import mujoco

        names = rover.wheel_names
        turning = [name for name, steers in zip(names, rover.steers, strict=True) if steers]
        self.rover, self.model, self.data = rover, model, mujoco.MjData(model)
        self._hinge_q = _indices("qposadr", [model.joint(name) for name in HINGES])
        self._hinge_v = _indices("dofadr", [model.joint(name) for name in HINGES])
        self._steer_q = _indices("qposadr", [model.joint(f"steer_{name}") for name in turning])
        self._wheel_q = _indices("qposadr", [model.joint(f"wheel_{name}") for name in names])
        self._wheel_v = _indices("dofadr", [model.joint(f"wheel_{name}") for name in names])
        self._steer_motor = _indices("id", [model.actuator(f"steer_{name}") for name in turning])
        self._wheel_motor = _indices("id", [model.actuator(f"wheel_{name}") for name in names])
        self._geoms = _indices("id", [model.geom(name) for name in (*(f"wheel_{n}" for n in names), "body")])
        self._command = np.zeros((2, 6))

    def place(self, pose: Pose, lift: float) -> None:
        """Put the rover at one settled pose, `lift` m above it, at rest, its steering held."""
        import mujoco

        data, T = self.data, pose.T_world_body
        mujoco.mj_resetData(self.model, data)
        data.qpos[:3] = T[:3, 3] + (0.0, 0.0, lift)
        mujoco.mju_mat2Quat(data.qpos[3:7], np.ascontiguousarray(T[:3, :3]).ravel())
        data.qpos[self._hinge_q] = [pose.rocker, self.rover.right_rocker(pose.rocker), *pose.bogie]
        data.qpos[self._steer_q] = pose.steering[self.rover.steers]
        self.command(np.zeros(6), pose.steering)

    def command(self, wheel_rate: Array, steering: Array) -> None:
        """Ask the hubs for rates (6,), rad/s, and the steering for angles (6,), rad."""
        self._command = np.stack([wheel_rate, steering])
        self.data.ctrl[self._wheel_motor] = wheel_rate
        self.data.ctrl[self._steer_motor] = steering[self.rover.steers]

    def step(self, seconds: float) -> None:
        """Let time pass.

        Raises:
            RockerbogieError: the simulation became unstable.
        """
        import mujoco

        mujoco.mj_step(self.model, self.data, nstep=round(seconds / self.model.opt.timestep))
        unstable = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
        if any(self.data.warning[int(kind)].number for kind in unstable):
            raise RockerbogieError(
                f"the simulation became unstable within {self.data.time:.2f} s: drive more slowly or over smoother ground"
            )

    @property
    def heading(self) -> tuple[float, float, float]:
        """x, y (m) and yaw (rad) of the body."""
        x, y, _, qw, qx, qy, qz = self.data.qpos[:7]
        return float(x), float(y), quaternion_angles(qw, qx, qy, qz)[2]

    @property
    def hubs(self) -> Array:
        """(6, 3) in the world, as of the last step, m."""
        return np.asarray(self.data.geom_xpos[self._geoms[:6]])

    @property
    def upright(self) -> float:
        """Cosine of the angle between the body's z and the vertical."""
        _, qx, qy, _ = self.data.qpos[3:7]
        return float(1 - 2 * (qx**2 + qy**2))

    def contact_normals(self) -> Array:
        """(6, 3) up from the ground into each wheel, where several touch their mean by force; straight up in the air."""
        push = self._push()[:, :6]
        normal = np.reshape(self.data.contact.frame, (-1, 9))[:, :3]
        mean = push.T @ (normal * np.sign(normal[:, 2:]))
        mean[push.sum(axis=0) == 0] = 0.0, 0.0, 1.0
        return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))

    def _push(self) -> Array:
        """(contacts, 7) normal force of each contact on the six wheels and the body's box, N."""
        contact = self.data.contact
        touches = (np.reshape(contact.geom, (-1, 2))[:, None, :] == self._geoms[:, None]).any(axis=-1)
        return np.where(touches, self.data.efc_force[contact.efc_address][:, None], 0.0)

    def _wheel_motion(self) -> Array:
        """(6, 6) of each wheel in the world: velocity of its hub, angular velocity. As of the last step."""
        import mujoco

        spin_first = np.zeros((6, 6))
        for found, geom in zip(spin_first, self._geoms[:6], strict=True):
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_GEOM, geom, found, 0)
        return np.roll(spin_first, 3, axis=1)

    def record(self) -> Record:
        """Read everything at this instant."""
        import mujoco

        data = self.data
        mujoco.mj_forward(self.model, data)  # contacts and forces of this very state
        steering = np.zeros(6)
        steering[self.rover.steers] = data.qpos[self._steer_q]
        push = self._push()
        force = push.sum(axis=0)
        point = np.full((6, 3), np.nan)
        bears = force[:6] > 0
        if bears.any():
            point[bears] = np.reshape(data.contact.pos, (-1, 3))[push[:, :6].argmax(axis=0)[bears]]
        return Record(
            time=data.time, place=data.qpos[:7].copy(), velocity=data.qvel[:6].copy(),
            hinge=data.qpos[self._hinge_q], hinge_rate=data.qvel[self._hinge_v],
            steering=steering, wheel_angle=data.qpos[self._wheel_q], wheel_rate=data.qvel[self._wheel_v],
            wheel_motion=self._wheel_motion(), contact_normal=self.contact_normals(),
            contact_point=point, contact_force=force[:6], body_force=float(force[6]),
            wheel_rate_command=self._command[0], steering_command=self._command[1],
        )  # fmt: skip


def _indices(field: str, elements: list[Any]) -> Indices:
    return np.array([int(np.ravel(getattr(element, field))[0]) for element in elements], dtype=np.int64)
