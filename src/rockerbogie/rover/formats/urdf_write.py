"""URDF writer."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from ...arrays import Array
from ..model import Rover
from .export_tree import tree_of
from .tree import Joint, Part, Tree

#: Effort and velocity limits, which URDF requires and a rover does not state: larger than any rover's (N m, rad/s).
EFFORT, SPEED = "1000", "10"
#: Written for the open side of a joint that has a limit on its other side, rad.
FAR = 1e6
#: The link that holds the body's mass and shapes: ROS's KDL parser accepts no mass on the root link.
BODY_LINK, BODY_JOINT = "body", "body_joint"


def to_urdf(rover: Rover, *, ros2_control: bool = False) -> str:
    """Return the rover as URDF.

    It has masses, collision cylinders, limits, and the differential as a `mimic` joint, which Drake holds and many engines do
    not (docs/formats.md).

    The root `base_link` has no mass; the body's mass and box are on the link `body`, fixed to it. A differential that is not
    a plain ratio is written as its slope at rest, and in full in `<rockerbogie differential="...">`, which other readers ignore.

    Args:
        rover: the rover to write.
        ros2_control: add a `<ros2_control>` block (gz_ros2_control): steering by position, wheels by velocity.

    Returns:
        URDF text.

    Raises:
        RoverError: not a rover.
    """
    tree = tree_of(rover)
    robot = Element("robot", name=tree.name)
    if tree.differential is not None:
        SubElement(robot, "rockerbogie", differential=_text(*tree.differential))
    for part in tree.parts.values():
        if part.name == tree.root:
            SubElement(robot, "link", name=tree.root)
            _add_link(robot, BODY_LINK, part)
            body = SubElement(robot, "joint", name=BODY_JOINT, type="fixed")
            _add_ends(body, tree.root, BODY_LINK, np.zeros(3))
        else:
            _add_link(robot, part.name, part)
    for joint in tree.joints.values():
        _add_joint(robot, joint)
    if ros2_control:
        _add_ros2_control(robot, tree)
    indent(robot)
    return '<?xml version="1.0"?>\n' + tostring(robot, encoding="unicode") + "\n"


def _add_link(robot: Element, name: str, part: Part) -> None:
    """Add a link with its mass properties and shapes."""
    link = SubElement(robot, "link", name=name)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(*part.com), rpy="0 0 0")
    SubElement(inertial, "mass", value=_text(part.mass))
    SubElement(inertial, "inertia", _moments(part.inertia))
    for shape in part.shapes:
        roll = np.pi / 2 if shape.kind == "cylinder" else 0.0
        for use in ("visual", "collision"):
            element = SubElement(link, use, name=f"{shape.name}_{use}")
            SubElement(element, "origin", xyz=_text(*shape.T[:3, 3]), rpy=_text(roll, 0.0, 0.0))
            geometry = SubElement(element, "geometry")
            if shape.kind == "box":
                SubElement(geometry, "box", size=_text(*shape.size))
            else:
                SubElement(geometry, "cylinder", radius=_text(shape.size[0]), length=_text(shape.size[1]))


def _add_ends(element: Element, parent: str, child: str, at: Array) -> None:
    """Add a joint's origin and the links it joins."""
    SubElement(element, "origin", xyz=_text(*at), rpy="0 0 0")
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)


def _add_joint(robot: Element, joint: Joint) -> None:
    """Add a hinge: revolute if it has a limit on either side, else continuous."""
    low, high = joint.limits or (-np.inf, np.inf)
    bounded = np.isfinite(low) or np.isfinite(high)
    element = SubElement(robot, "joint", name=joint.name, type="revolute" if bounded else "continuous")
    _add_ends(element, joint.parent, joint.child, joint.T[:3, 3])
    SubElement(element, "axis", xyz=_text(*(joint.axis if joint.axis is not None else (1.0, 0.0, 0.0))))
    ends = {"lower": _text(max(low, -FAR)), "upper": _text(min(high, FAR))} if bounded else {}
    SubElement(element, "limit", ends, effort=EFFORT, velocity=SPEED)
    if joint.mimic is not None:
        leader, (offset, multiplier) = joint.mimic
        SubElement(element, "mimic", joint=leader, multiplier=_text(multiplier), offset=_text(offset))


def _add_ros2_control(robot: Element, tree: Tree) -> None:
    """Add the hardware block: each joint's states, and commands for steering and wheels."""
    block = SubElement(robot, "ros2_control", name=f"{tree.name}_hardware", type="system")
    SubElement(SubElement(block, "hardware"), "plugin").text = "gz_ros2_control/GazeboSimSystem"
    for joint in tree.joints.values():
        element = SubElement(block, "joint", name=joint.name)
        driven = {"steer": "position", "wheel": "velocity"}.get(joint.child.partition("_")[0])
        if driven:
            SubElement(element, "command_interface", name=driven)
        for state in ("position", "velocity"):
            SubElement(element, "state_interface", name=state)
    gazebo = SubElement(robot, "gazebo")
    SubElement(gazebo, "plugin", filename="gz_ros2_control-system", name="gz_ros2_control::GazeboSimROS2ControlPlugin")


def _text(*values: float) -> str:
    """Return numbers as text that reads back to the same bits."""
    return " ".join(repr(float(v) + 0.0) for v in values)


def _moments(inertia: Array) -> dict[str, str]:
    """Return the attributes ixx ... izz of an inertia (3, 3)."""
    return {f"i{'xyz'[i]}{'xyz'[j]}": _text(inertia[i, j]) for i in range(3) for j in range(i, 3)}
