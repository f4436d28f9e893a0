"""Gazebo system that couples the two rockers of a rover: its differential.

`rockerbogie export` writes a copy of this file beside a world or an SDF file. It needs only Gazebo's Python bindings.
gz sim 8 (Harmonic) or newer finds it in the folders of GZ_SIM_SYSTEM_PLUGIN_PATH:

    GZ_SIM_SYSTEM_PLUGIN_PATH=. gz sim world.sdf

The system works with every physics engine, as it applies joint torques only. The differential is right = p(left), p a
polynomial. Its error is e = right − p(left). The torque T = −k e − c ė acts on the right rocker, and −p'(left) T on the left
rocker: together they do no work along the differential. With the step dt and the inertia m of e (in `<inertia>`),
k = STIFFNESS m / dt² and c = DAMPING m / dt.
"""

from __future__ import annotations

import importlib
from typing import Any

#: Share of the error, and of its rate, that is removed in one step of a free rover. Explicit steps are stable while
#: STIFFNESS + 2 DAMPING < 4.
STIFFNESS, DAMPING = 0.5, 1.0
#: Names of Gazebo's Python module, the newest first.
MODULES = ("gz.sim", "gz.sim10", "gz.sim9", "gz.sim8")


class Differential:
    """Coupling of two joints by equal and opposite torques."""

    def configure(self, entity: Any, sdf: Any, ecm: Any, events: Any) -> None:
        """Read the parameters, and enable position and velocity of both joints.

        Args:
            entity: of the model.
            sdf: the `<plugin>` element: `<left>`, `<right>` (names of joints), `<inertia>` (kg m²), `<coefficients>` (of the
                polynomial, lowest power first).
            ecm: Gazebo's entity-component manager.
            events: Gazebo's event manager; not used.
        """
        sim = gazebo_module()
        model = sim.Model(entity)
        self.joints = []
        for side in ("left", "right"):
            name = sdf.get_string(side)
            joint = sim.Joint(model.joint_by_name(ecm, name))
            if not joint.valid(ecm):
                raise ValueError(f"rockerbogie_differential: the model has no joint {name!r}, which <{side}> names")
            joint.enable_position_check(ecm, True)
            joint.enable_velocity_check(ecm, True)
            self.joints.append(joint)
        self.inertia = float(sdf.get_string("inertia"))
        self.coefficients = [float(word) for word in sdf.get_string("coefficients").split()]

    def pre_update(self, info: Any, ecm: Any) -> None:
        """Apply the torques of one step.

        Args:
            info: Gazebo's times: `dt`, `paused`.
            ecm: Gazebo's entity-component manager.
        """
        dt = info.dt.total_seconds()
        angles = [joint.position(ecm) for joint in self.joints]
        rates = [joint.velocity(ecm) for joint in self.joints]
        if info.paused or dt <= 0 or not all(angles) or not all(rates):  # the first step has no positions yet
            return
        left, right, value, slope = angles[0][0], angles[1][0], 0.0, 0.0
        for coefficient in reversed(self.coefficients):
            value, slope = value * left + coefficient, slope * left + value
        error, rate = right - value, rates[1][0] - slope * rates[0][0]
        torque = -self.inertia * (STIFFNESS * error / dt + DAMPING * rate) / dt
        self.joints[0].set_force(ecm, [-slope * torque])
        self.joints[1].set_force(ecm, [torque])


def get_system() -> Differential:
    """Return the system, as Gazebo's loader of Python systems requires.

    Returns:
        A new system.
    """
    return Differential()


def gazebo_module() -> Any:
    """Import the Python bindings of the running Gazebo.

    Returns:
        The module `gz.sim`, whose name has a version in older releases.

    Raises:
        ModuleNotFoundError: none of `MODULES` is installed.
    """
    for name in MODULES:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError:
            continue
    raise ModuleNotFoundError(f"Gazebo's Python bindings are not installed: none of {', '.join(MODULES)} can be imported")
