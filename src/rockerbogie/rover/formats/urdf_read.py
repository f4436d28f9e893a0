"""URDF reader: links, joints, shapes and masses; transmissions and plug-ins are ignored."""

from __future__ import annotations

from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from ...arrays import Array
from ...errors import RoverError
from .meshes import MeshFolder
from .safe_xml import numbers, parse_xml
from .tree import Joint, Part, Shape, Tree, connected, from_rpy, place

KINDS: dict[str, Literal["fixed", "hinge", "other"]] = {
    "fixed": "fixed",
    "revolute": "hinge",
    "continuous": "hinge",
    "prismatic": "other",
    "floating": "other",
    "planar": "other",
}
#: Elements of unexpanded xacro, with or without the prefix (older files leave it out).
MACROS = ("macro", "property", "include", "insert_block", "arg")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def read_urdf(data: bytes | str, what: str = "robot.urdf", meshes: MeshFolder | None = None) -> list[Tree]:
    """Return the trees of a URDF text (expanded, if it came from xacro), the largest first.

    Args:
        data: the text.
        what: the file's name, for messages.
        meshes: reader of the mesh files it refers to; None: meshes are not read.

    Returns:
        The trees.

    Raises:
        RoverError: refused XML, unexpanded macros, or a faulty description.
    """
    robot = parse_xml(data, what)
    if robot.tag != "robot":
        raise RoverError(f"{what}: its root element is <{robot.tag[:40]}>; a URDF begins with <robot>")
    _refuse_macros(robot, what)
    reader = _Reader(what, meshes or MeshFolder(None))
    tree = Tree(robot.get("name") or "rover", {}, {})
    for link in robot.findall("link"):
        part = reader.link(link)
        if len(link.findall("inertial")) > 1:
            tree.notes.append(f"link {part.name!r} has more than one <inertial>: the first is read")
        if part.name in tree.parts:
            raise RoverError(f"{what}: two links are called {part.name!r}")
        tree.parts[part.name] = part
    for element in robot.findall("joint"):
        joint = reader.joint(element, tree)
        if joint.name in tree.joints:
            raise RoverError(f"{what}: two joints are called {joint.name!r}")
        tree.joints[joint.name] = joint
    extra = robot.find("rockerbogie")
    if extra is not None and extra.get("differential") is not None:
        words = (extra.get("differential") or "").split()
        tree.differential = np.array(numbers(" ".join(words), len(words), f"{what}: <rockerbogie differential>"))
    if any(element.find("joint") is not None or element.find("link") is not None for element in robot.findall("gazebo")):
        tree.notes.append(
            "links or joints inside <gazebo> are not read; the rover's own differential stands for bars closed there"
        )
    tree.unread = [f"{address}: {reason}" for address, reason in reader.meshes.failed.items()]
    return connected(tree, what)


def _refuse_macros(robot: Element, what: str) -> None:
    """Raise an error if the file is unexpanded xacro, in its present or its old form."""
    prefixes = {"xacro"} | {key[6:] for key, value in robot.attrib.items() if key.startswith("xmlns:") and "xacro" in value}
    prefixed = [e.tag for e in robot.iter() if e.tag.partition(":")[0] in prefixes and ":" in e.tag]
    old = [e.tag for e in robot if e.tag in MACROS]
    values = [value for e in robot.iter() for value in e.attrib.values() if "${" in value or "$(" in value]
    if found := [*(f"<{tag}>" for tag in (*prefixed, *old)), *values]:
        raise RoverError(f"{what}: it still holds xacro macros ({found[0][:40]}); expand it first: `xacro {what} > robot.urdf`")


def _origin(element: Element | None, where: str) -> Array:
    """Return the transform (4, 4) of an element's <origin>; identity if it has none."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.eye(4)
    zero = (0.0, 0.0, 0.0)
    return place(
        numbers(origin.get("xyz"), 3, f"{where} xyz", zero), from_rpy(*numbers(origin.get("rpy"), 3, f"{where} rpy", zero))
    )


class _Reader:
    """Reader of one file's elements: its name for messages, its meshes."""

    def __init__(self, what: str, meshes: MeshFolder) -> None:
        self.what, self.meshes = what, meshes

    def link(self, link: Element) -> Part:
        """Return a link with its mass properties and shapes."""
        name = link.get("name")
        if not name:
            raise RoverError(f"{self.what}: a <link> has no name")
        where = f"{self.what}: link {name!r}"
        part = Part(name)
        inertial = link.find("inertial")
        if inertial is not None:
            T = _origin(inertial, where)
            mass, inertia = inertial.find("mass"), inertial.find("inertia")
            part.mass = numbers(None if mass is None else mass.get("value"), 1, f"{where} mass", (0.0,))[0]
            xx, yy, zz, xy, xz, yz = (
                numbers(None if inertia is None else inertia.get(k), 1, f"{where} {k}", (0.0,))[0] for k in MOMENTS
            )
            own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            part.com, part.inertia = T[:3, 3], T[:3, :3] @ own @ T[:3, :3].T
            if part.mass < 0:
                raise RoverError(f"{where} has a mass of {part.mass:g} kg; give 0 or more")
        for use in ("collision", "visual"):
            for element in link.findall(use):
                shape = self.shape(element, where, use == "collision")
                if shape is not None:
                    part.shapes.append(shape)
        return part

    def shape(self, element: Element, where: str, collides: bool) -> Shape | None:
        """Return a collision or visual shape, None if the element has no geometry."""
        geometry = element.find("geometry")
        kind = None if geometry is None or not len(geometry) else geometry[0]
        if kind is None:
            return None
        T, name = _origin(element, where), element.get("name", "")
        if kind.tag == "mesh":
            scale = np.array(numbers(kind.get("scale"), 3, f"{where} mesh scale", (1.0, 1.0, 1.0)))
            mesh = self.meshes.load(kind.get("filename") or "")
            return Shape("mesh", (), T, name, collides, None if mesh is None else mesh.scaled(scale))
        fields = {
            "box": (("size", 3),),
            "cylinder": (("radius", 1), ("length", 1)),
            "capsule": (("radius", 1), ("length", 1)),
            "sphere": (("radius", 1),),
        }
        if kind.tag not in fields:
            return Shape("mesh", (), T, name, collides)
        size: tuple[float, ...] = ()
        for key, count in fields[kind.tag]:
            size += numbers(kind.get(key), count, f"{where} {kind.tag} {key}")
        if min(size) < 0:
            raise RoverError(f"{where} has a {kind.tag} of size {min(size):g}; give 0 or more")
        return Shape(kind.tag, size, T, name, collides)

    def joint(self, element: Element, tree: Tree) -> Joint:
        """Return a joint; properties that a rover does not have are recorded in the tree."""
        name = element.get("name")
        if not name:
            raise RoverError(f"{self.what}: a <joint> has no name")
        where = f"{self.what}: joint {name!r}"
        ends = {}
        for end in ("parent", "child"):
            found = element.find(end)
            ends[end] = "" if found is None else found.get("link") or ""
            if not ends[end]:
                raise RoverError(f"{where} names no {end} link")
        kind = element.get("type") or ""
        if kind not in KINDS:
            raise RoverError(f"{where} is of type {element.get('type')!r}; URDF has {', '.join(KINDS)}")
        joint = Joint(name, KINDS[kind], ends["parent"], ends["child"], _origin(element, where))
        axis = element.find("axis")
        if axis is not None or joint.kind == "hinge":
            vector = np.array(numbers(None if axis is None else axis.get("xyz"), 3, f"{where} axis", (1.0, 0.0, 0.0)))
            length = float(np.linalg.norm(vector))
            if length < 1e-9 and joint.kind == "hinge":
                raise RoverError(f"{where} has an axis of no length")
            joint.axis = vector / length if length >= 1e-9 else None
        if joint.kind == "other":
            tree.drop(f"motion of a {kind} joint, held at rest", name)
        self._limits(element, joint, kind, where, tree)
        mimic = element.find("mimic")
        if mimic is not None:
            multiplier = numbers(mimic.get("multiplier"), 1, f"{where} mimic multiplier", (1.0,))[0]
            offset = numbers(mimic.get("offset"), 1, f"{where} mimic offset", (0.0,))[0]
            joint.mimic = (mimic.get("joint") or "", (offset, multiplier))
        dynamics = element.find("dynamics")
        if dynamics is not None and joint.kind != "fixed":
            for key in ("damping", "friction"):
                if numbers(dynamics.get(key), 1, f"{where} {key}", (0.0,))[0]:
                    tree.drop(f"joint {key}", name)
        return joint

    def _limits(self, element: Element, joint: Joint, kind: str, where: str, tree: Tree) -> None:
        """Set the joint's limits (rad); those of a continuous joint do not count and are noted."""
        limit = element.find("limit")
        if limit is None or limit.get("lower") is None:
            if kind == "revolute" and (limit is None or limit.get("upper") is None):
                tree.notes.append(f"joint {joint.name!r} is revolute without limits: taken as continuous")
                return
            if limit is None or limit.get("upper") is None:
                return
        if kind == "continuous":
            tree.notes.append(f"joint {joint.name!r} is continuous: the limits it also gives do not count")
            return
        low, high = (numbers(limit.get(k), 1, f"{where} limit {k}", (0.0,), finite=False)[0] for k in ("lower", "upper"))
        joint.limits = (low, high)
