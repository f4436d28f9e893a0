"""Joints of a robot matched to the rover's sensors, by names or by a robot description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..logs.channels import LogReport, column_names
from ..logs.names import Match, joint_roles, match_columns
from ..rover.formats import build_rover, read_trees
from ..rover.formats.import_search import find_roles
from ..rover.model import Rover

TOPIC = "joint_states"


def parse_names(pairs: Sequence[str]) -> dict[str, str]:
    """Return the joint names of a parameter.

    Args:
        pairs: "theirs=ours" each, where ours is a column (`steering_LF`) or a joint (`steer_LF_joint`), with a minus before
            ours for the opposite sign. Empty texts are left out.

    Returns:
        Their names -> ours.

    Raises:
        RockerbogieError: a text that is not a pair, or a joint that is given twice.
    """
    found = {}
    for pair in pairs:
        theirs, equals, ours = pair.partition("=")
        if not pair.strip():
            continue
        if not (theirs.strip() and equals and ours.strip()):
            raise RockerbogieError(f"joint_names: {pair!r} is not a pair; give THEIRS=OURS, as in corner_fl=-steering_LF")
        if theirs.strip() in found:
            raise RockerbogieError(f"joint_names: {theirs.strip()!r} is given twice; give each of your joints once")
        found[theirs.strip()] = ours.strip()
    return found


@dataclass
class JointReader:
    """Reader of joint states under any names, spread over any number of messages."""

    rover: Rover
    names: Mapping[str, str] = field(default_factory=dict)
    _known: dict[tuple[str, ...], dict[str, Match]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        """Check the names; raise if one is given as a column that there is not."""
        match_columns({TOPIC: tuple(self.names)}, self.rover, self.names, "joint_names", LogReport())

    def read(self, names: Sequence[str], position: Sequence[float], velocity: Sequence[float]) -> dict[str, float]:
        """Return the values of a message by our columns.

        Args:
            names: joints of the message.
            position: rad, as long as the names, or empty.
            velocity: rad/s, as long as the names, or empty.

        Returns:
            Column (`wheel_angle_LF`, `steering_LF`, `rocker`, `bogie_left`, …) -> rad or rad/s; NaN as it came.

        Raises:
            RockerbogieError: lists of other lengths, or joints that could mean the same column.
        """
        for what, values in (("position", position), ("velocity", velocity)):
            if len(values) not in (0, len(names)):
                raise RockerbogieError(f"a joint state has {len(names)} names and {len(values)} values of {what}")
        matches = self._matches(names, velocity)
        given = dict(zip(names, position, strict=False)) | {f"{n}.rate": v for n, v in zip(names, velocity, strict=False)}
        return {ours: m.sign * float(given[m.column]) for ours, m in matches.items() if m.column in given}

    def _matches(self, names: Sequence[str], velocity: Sequence[float]) -> dict[str, Match]:
        """Return our columns -> theirs of the joints of a message, with or without velocities."""
        columns = (*names, *(f"{n}.rate" for n in names)) if len(velocity) else tuple(names)
        matches = self._known.get(columns)
        if matches is None:
            mine = {theirs: ours for theirs, ours in self.names.items() if theirs in names or f"{theirs}_joint" in names}
            matches = match_columns({TOPIC: columns}, self.rover, mine, "the joint state", LogReport())
            self._known[columns] = matches
        return matches

    def efforts(self, names: Sequence[str], effort: Sequence[float]) -> dict[int, float]:
        """Return the torques of the wheel motors in a message that `read` has read.

        Args:
            names: joints of the message.
            effort: N·m, as long as the names, or empty.

        Returns:
            Index of the wheel -> N·m, forward positive; NaN as it came.

        Raises:
            RockerbogieError: lists of different lengths.
        """
        if len(effort) not in (0, len(names)):
            raise RockerbogieError(f"a joint state has {len(names)} names and {len(effort)} values of effort")
        if not len(effort):
            return {}
        matches = self._matches(names, ())
        given = dict(zip(names, effort, strict=True))
        angles = ((i, matches.get(f"wheel_angle_{w}")) for i, w in enumerate(self.rover.wheel_names))
        return {i: m.sign * float(given[m.column]) for i, m in angles if m is not None and m.column in given}


@dataclass(frozen=True)
class MotorNames:
    """Names and signs of the joints that take commands."""

    wheels: tuple[str, ...]  # six, in the order of the rover's wheels
    wheel_signs: Array  # (6,)
    steering: tuple[str, ...]  # of the wheels that steer
    steering_signs: Array  # as many

    @classmethod
    def of(cls, rover: Rover, names: Mapping[str, str]) -> MotorNames:
        """Return the robot's names of the motors.

        Args:
            rover: the rover.
            names: their names -> ours.

        Returns:
            Their names where given, else those of `to_urdf`.
        """
        ours, roles = column_names(rover), joint_roles(rover)
        theirs: dict[str, tuple[str, float]] = {}
        for name, given in names.items():
            sign, target = (-1.0, given[1:].strip()) if given.startswith("-") else (1.0, given)
            column = target if target in ours else roles.get(target.lower(), (target, ""))[0]
            theirs[column.replace("wheel_rate", "wheel_angle")] = (name, sign)
        wheels = [theirs.get(f"wheel_angle_{w}", (f"wheel_{w}_joint", 1.0)) for w in rover.wheel_names]
        turning = [w for w, steers in zip(rover.wheel_names, rover.steers, strict=True) if steers]
        steering = [theirs.get(f"steering_{w}", (f"steer_{w}_joint", 1.0)) for w in turning]
        return cls(
            tuple(name for name, _ in wheels), np.array([sign for _, sign in wheels]),
            tuple(name for name, _ in steering), np.array([sign for _, sign in steering]),
        )  # fmt: skip


def read_description(text: str) -> tuple[Rover, dict[str, str]]:
    """Return the rover of a robot description, and its joint names.

    Args:
        text: URDF, SDF or MJCF.

    Returns:
        The rover; their joint names -> our columns, with a minus where a joint turns the other way.

    Raises:
        RockerbogieError: text that holds no rocker-bogie rover.
    """
    trees = read_trees(text, "robot_description")
    rover = build_rover(trees, "robot_description").rover
    roles = find_roles(trees[0], "robot_description", {}, None, None)
    across, up = roles.axes[:, 1], roles.axes[:, 2]
    found = {}
    for hinge, column, axis in (
        *((h, f"wheel_angle_{w}", across) for h, w in zip(roles.wheels, rover.wheel_names, strict=True)),
        *((h, f"steering_{w}", up) for h, w in zip(roles.steers, rover.wheel_names, strict=True)),
        *((h, f"bogie_{side}", across) for h, side in zip(roles.bogies, ("left", "right"), strict=True)),
        (roles.rockers[0], "rocker", across),
    ):
        if hinge is not None:
            found[hinge.joint.name] = f"{'-' if float(axis @ hinge.axis) < 0 else ''}{column}"
    return rover, found
