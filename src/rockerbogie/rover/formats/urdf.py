"""URDF in and out. Reading keeps the kinematic tree and forgets looks, transmissions and plug-ins."""

from __future__ import annotations

from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from ...errors import RoverError
from ..model import Rover
from .safe_xml import numbers, parse_xml
from .tree import Joint, Part, Shape, Tree, from_rpy, place, tree_of

Array = NDArray[np.float64]

#: What URDF demands of a joint and a rover does not say: room enough for any of them (N m, rad/s).
EFFORT, SPEED = "1000", "10"
#: Stands for "no stop on this side" where the other side has one.
FAR = 1e6


def to_urdf(rover: Rover, *, ros2_control: bool = False) -> str:
    """The rover as URDF: inertias, collision cylinders, limits, and the differential as a `mimic` joint.

    A differential other than a plain ratio is written as the nearest thing URDF has, its slope at rest, and whole in an
    element `<rockerbogie differential="...">` that other readers pass over.

    Args:
        ros2_control: add a `<ros2_control>` block (gz_ros2_control): steering by position, wheels by velocity.
    """
    tree = tree_of(rover)
    robot = Element("robot", name=tree.name)
    if tree.differential is not None:
        SubElement(robot, "rockerbogie", differential=_text(*tree.differential))
    for part in tree.parts.values():
        link = SubElement(robot, "link", name=part.name)
        inertial = SubElement(link, "inertial")
        SubElement(inertial, "origin", xyz=_text(*part.com), rpy="0 0 0")
        SubElement(inertial, "mass", value=_text(part.mass))
        SubElement(inertial, "inertia", _moments(part.inertia))
        for shape in part.shapes:
            for use in ("visual", "collision"):
                element = SubElement(link, use, name=f"{shape.name}_{use}")
                SubElement(
                    element,
                    "origin",
                    xyz=_text(*shape.T[:3, 3]),
                    rpy=_text(np.pi / 2 if shape.kind == "cylinder" else 0.0, 0.0, 0.0),
                )
                geometry = SubElement(element, "geometry")
                if shape.kind == "box":
                    SubElement(geometry, "box", size=_text(*shape.size))
                else:
                    SubElement(geometry, "cylinder", radius=_text(shape.size[0]), length=_text(shape.size[1]))
    for joint in tree.joints.values():
        low, high = joint.limits or (-np.inf, np.inf)
        bounded = np.isfinite(low) or np.isfinite(high)
        element = SubElement(robot, "joint", name=joint.name, type="revolute" if bounded else "continuous")
        SubElement(element, "origin", xyz=_text(*joint.T[:3, 3]), rpy="0 0 0")
        SubElement(element, "parent", link=joint.parent)
        SubElement(element, "child", link=joint.child)
        SubElement(element, "axis", xyz=_text(*(joint.axis if joint.axis is not None else (1.0, 0.0, 0.0))))
        ends = {"lower": _text(max(low, -FAR)), "upper": _text(min(high, FAR))} if bounded else {}
        SubElement(element, "limit", ends, effort=EFFORT, velocity=SPEED)
        if joint.mimic is not None:
            SubElement(element, "mimic", joint=joint.mimic[0], multiplier=_text(joint.mimic[1]), offset=_text(joint.mimic[2]))
    if ros2_control:
        _add_ros2_control(robot, tree)
    indent(robot)
    return '<?xml version="1.0"?>\n' + tostring(robot, encoding="unicode") + "\n"


def _add_ros2_control(robot: Element, tree: Tree) -> None:
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
    """Numbers that read back to the same bits."""
    return " ".join(repr(float(v) + 0.0) for v in values)


def _moments(inertia: Array) -> dict[str, str]:
    return {f"i{'xyz'[i]}{'xyz'[j]}": _text(inertia[i, j]) for i in range(3) for j in range(i, 3)}


def read_urdf(data: bytes | str, what: str = "robot.urdf") -> Tree:
    """The kinematic tree of a URDF text (expanded, if it came from xacro).

    Raises:
        RoverError: XML that is refused, or a description that makes no tree.
    """
    robot = parse_xml(data, what)
    if robot.tag != "robot":
        raise RoverError(f"{what}: its root element is <{robot.tag[:40]}>; a URDF begins with <robot>")
    if any(element.tag.startswith("xacro:") for element in robot.iter()):
        raise RoverError(f"{what}: it still holds xacro macros; expand it first: `xacro {what} > robot.urdf`")
    tree = Tree(robot.get("name") or "rover", {}, {})
    for link in robot.findall("link"):
        part = _read_link(link, what)
        if part.name in tree.parts:
            raise RoverError(f"{what}: two links are called {part.name!r}")
        tree.parts[part.name] = part
    for element in robot.findall("joint"):
        joint = _read_joint(element, what)
        if joint.name in tree.joints:
            raise RoverError(f"{what}: two joints are called {joint.name!r}")
        tree.joints[joint.name] = joint
        limit = element.find("limit")
        if element.get("type") == "continuous" and limit is not None and limit.get("lower") is not None:
            tree.notes.append(f"joint {joint.name!r} is continuous: the limits it is given besides do not count")
    extra = robot.find("rockerbogie")
    if extra is not None and extra.get("differential") is not None:
        words = (extra.get("differential") or "").split()
        tree.differential = np.array(numbers(" ".join(words), len(words), f"{what}: <rockerbogie differential>"))
    if any(element.find("joint") is not None or element.find("link") is not None for element in robot.findall("gazebo")):
        tree.notes.append(
            "passed over links or joints inside <gazebo>: bars closed there are taken up by the rover's own differential"
        )
    if not tree.parts:
        raise RoverError(f"{what}: it holds no link")
    return tree.arrange(what)


def _origin(element: Element | None, where: str) -> Array:
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.eye(4)
    zero = (0.0, 0.0, 0.0)
    return place(
        numbers(origin.get("xyz"), 3, f"{where} xyz", zero), from_rpy(*numbers(origin.get("rpy"), 3, f"{where} rpy", zero))
    )


def _read_link(link: Element, what: str) -> Part:
    name = link.get("name")
    if not name:
        raise RoverError(f"{what}: a <link> has no name")
    where = f"{what}: link {name!r}"
    part = Part(name)
    inertial = link.find("inertial")
    if inertial is not None:
        T = _origin(inertial, where)
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        part.mass = numbers(None if mass is None else mass.get("value"), 1, f"{where} mass", (0.0,))[0]
        six = {
            k: numbers(None if inertia is None else inertia.get(k), 1, f"{where} {k}", (0.0,))[0]
            for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        }
        own = np.array(
            [[six["ixx"], six["ixy"], six["ixz"]], [six["ixy"], six["iyy"], six["iyz"]], [six["ixz"], six["iyz"], six["izz"]]]
        )
        part.com, part.inertia = T[:3, 3], T[:3, :3] @ own @ T[:3, :3].T
        if part.mass < 0:
            raise RoverError(f"{where} has a mass of {part.mass:g} kg; give 0 or more")
    for use in ("collision", "visual"):
        for element in link.findall(use):
            shape = _read_shape(element, where, use == "collision")
            if shape is not None:
                part.shapes.append(shape)
    return part


def _read_shape(element: Element, where: str, collides: bool) -> Shape | None:
    geometry = element.find("geometry")
    kind = None if geometry is None or not len(geometry) else geometry[0]
    if kind is None:
        return None
    T, name = _origin(element, where), element.get("name", "")
    if kind.tag == "box":
        size = numbers(kind.get("size"), 3, f"{where} box size")
    elif kind.tag == "cylinder":
        size = (
            *numbers(kind.get("radius"), 1, f"{where} cylinder radius"),
            *numbers(kind.get("length"), 1, f"{where} cylinder length"),
        )
    elif kind.tag == "sphere":
        size = numbers(kind.get("radius"), 1, f"{where} sphere radius")
    else:
        return Shape("mesh", (), T, name, collides)
    if min(size) < 0:
        raise RoverError(f"{where} has a {kind.tag} of size {min(size):g}; give 0 or more")
    return Shape(kind.tag, size, T, name, collides)


def _read_joint(element: Element, what: str) -> Joint:
    name = element.get("name")
    if not name:
        raise RoverError(f"{what}: a <joint> has no name")
    where = f"{what}: joint {name!r}"
    ends = {}
    for end in ("parent", "child"):
        found = element.find(end)
        ends[end] = "" if found is None else found.get("link") or ""
        if not ends[end]:
            raise RoverError(f"{where} names no {end} link")
    kinds: dict[str | None, Literal["fixed", "hinge", "other"]]
    kinds = {
        "fixed": "fixed",
        "revolute": "hinge",
        "continuous": "hinge",
        "prismatic": "other",
        "floating": "other",
        "planar": "other",
    }
    if element.get("type") not in kinds:
        raise RoverError(f"{where} is of type {element.get('type')!r}; URDF knows {', '.join(k for k in kinds if k)}")
    limit, mimic, axis = element.find("limit"), element.find("mimic"), element.find("axis")
    joint = Joint(name, kinds[element.get("type")], ends["parent"], ends["child"], _origin(element, where))
    if axis is not None or joint.kind == "hinge":
        vector = np.array(numbers(None if axis is None else axis.get("xyz"), 3, f"{where} axis", (1.0, 0.0, 0.0)))
        length = float(np.linalg.norm(vector))
        if length < 1e-9 and joint.kind == "hinge":
            raise RoverError(f"{where} has an axis of no length")
        joint.axis = vector / length if length >= 1e-9 else None
    if (
        limit is not None
        and limit.get("lower") is not None
        and limit.get("upper") is not None
        and element.get("type") != "continuous"
    ):
        low, high = (numbers(limit.get(k), 1, f"{where} limit {k}", finite=False)[0] for k in ("lower", "upper"))
        joint.limits = (low, high)
    if mimic is not None:
        multiplier = numbers(mimic.get("multiplier"), 1, f"{where} mimic multiplier", (1.0,))[0]
        joint.mimic = (mimic.get("joint") or "", multiplier, numbers(mimic.get("offset"), 1, f"{where} mimic offset", (0.0,))[0])
    return joint
