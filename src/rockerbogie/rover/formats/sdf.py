"""SDF (Gazebo's format) in and out. Reading takes the largest model of the file and keeps its links and joints."""

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

VERSION = "1.11"
EXTENSION = "rockerbogie:differential"
#: Frames may be placed relative to one another so many deep.
MAX_CHAIN = 100


def to_sdf(rover: Rover) -> str:
    """The rover as an SDF model: inertias, collision cylinders, limits, and the differential as a `mimic` axis.

    A differential other than a plain ratio keeps its slope at rest there, and is whole in `<rockerbogie:differential>`.
    """
    sdf = Element("sdf", {"version": VERSION, "xmlns:rockerbogie": "urn:rockerbogie"})
    sdf.append(model_element(rover))
    indent(sdf)
    return '<?xml version="1.0"?>\n' + tostring(sdf, encoding="unicode") + "\n"


def model_element(rover: Rover) -> Element:
    """The `<model>` alone, to be put into a world."""
    tree = tree_of(rover)
    rest = tree.rest()
    model = Element("model", name=tree.name)
    if tree.differential is not None:
        _leaf(model, EXTENSION, *tree.differential)
    for part in tree.parts.values():
        link = SubElement(model, "link", name=part.name)
        _leaf(link, "pose", *rest[part.name][:3, 3], 0, 0, 0)
        inertial = SubElement(link, "inertial")
        _leaf(inertial, "pose", *part.com, 0, 0, 0)
        _leaf(inertial, "mass", part.mass)
        inertia = SubElement(inertial, "inertia")
        for i in range(3):
            for j in range(i, 3):
                _leaf(inertia, f"i{'xyz'[i]}{'xyz'[j]}", part.inertia[i, j])
        for shape in part.shapes:
            for use in ("visual", "collision"):
                element = SubElement(link, use, name=f"{shape.name}_{use}")
                _leaf(element, "pose", *shape.T[:3, 3], np.pi / 2 if shape.kind == "cylinder" else 0, 0, 0)
                kind = SubElement(SubElement(element, "geometry"), shape.kind)
                if shape.kind == "box":
                    _leaf(kind, "size", *shape.size)
                else:
                    _leaf(kind, "radius", shape.size[0])
                    _leaf(kind, "length", shape.size[1])
    for joint in tree.joints.values():
        element = SubElement(model, "joint", name=joint.name, type="revolute")
        SubElement(element, "parent").text = joint.parent
        SubElement(element, "child").text = joint.child
        axis = SubElement(element, "axis")
        _leaf(axis, "xyz", *(joint.axis if joint.axis is not None else (0, 0, 1)))
        if joint.limits is not None and np.isfinite(joint.limits).any():
            limit = SubElement(axis, "limit")
            for name, value in zip(("lower", "upper"), joint.limits, strict=True):
                _leaf(limit, name, value)
        if joint.mimic is not None:
            mimic = SubElement(axis, "mimic", joint=joint.mimic[0])
            for name, value in zip(("multiplier", "offset", "reference"), (*joint.mimic[1:], 0.0), strict=True):
                _leaf(mimic, name, value)
    return model


def _leaf(parent: Element, tag: str, *values: float) -> None:
    SubElement(parent, tag).text = " ".join(repr(float(v) + 0.0) for v in values)


def read_sdf(data: bytes | str, what: str = "model.sdf") -> Tree:
    """The kinematic tree of the model with the most links in an SDF text.

    Raises:
        RoverError: XML that is refused, or a description that makes no tree.
    """
    root = parse_xml(data, what)
    models = list(root.iter("model"))
    if root.tag != "sdf" or not models:
        raise RoverError(f"{what}: an SDF begins with <sdf> and holds a <model>; here it begins with <{root.tag[:40]}>")
    return _Model(max(models, key=lambda m: len(m.findall("link"))), what).read()


class _Model:
    """One `<model>`, whose poses may each be given in any other frame of it."""

    def __init__(self, model: Element, what: str) -> None:
        self.model, self.what = model, what
        self.tree = Tree(model.get("name") or "rover", {}, {})
        self.frames: dict[str, Element] = {}
        for element in model:
            if element.tag in ("link", "joint", "frame"):
                name = element.get("name")
                if not name:
                    raise RoverError(f"{what}: a <{element.tag}> has no name")
                if name in self.frames:
                    raise RoverError(f"{what}: two parts are called {name!r}")
                self.frames[name] = element
        self.placed: dict[str, Array] = {}

    def read(self) -> Tree:
        tree = self.tree
        links = {name: e for name, e in self.frames.items() if e.tag == "link"}
        if not links:
            raise RoverError(f"{self.what}: model {tree.name!r} holds no link")
        joints = [self._joint(e) for e in self.frames.values() if e.tag == "joint"]
        rank = {"fixed": 0, "hinge": 0, "other": 1}
        root_of = {name: name for name in links}  # a forest: names lead to one of their own tree
        carried: set[str] = set()

        def top(name: str) -> str:
            while root_of[name] != name:
                root_of[name] = root_of[root_of[name]]
                name = root_of[name]
            return name

        own_frame = {name: self._place(name) for name in links}
        for joint, where in sorted((j for j in joints if j is not None), key=lambda j: rank[j[0].kind]):
            for end in (joint.parent, joint.child):
                if end not in links:
                    raise RoverError(f"{self.what}: joint {joint.name!r} joins {end!r}, which is no link of the model")
            if joint.child in carried or top(joint.parent) == top(joint.child):
                tree.notes.append(f"joint {joint.name!r} closes a loop; left open: the rover's differential stands for such bars")
                continue
            carried.add(joint.child)
            root_of[top(joint.child)] = joint.parent
            own_frame[joint.child] = where
            tree.joints[joint.name] = joint
        for name, element in links.items():
            tree.parts[name] = self._link(name, element, np.linalg.inv(own_frame[name]) @ self._place(name))
        for joint in tree.joints.values():
            joint.T = np.linalg.inv(own_frame[joint.parent]) @ own_frame[joint.child]
        extra = self.model.find(EXTENSION)
        if extra is not None:
            words = (extra.text or "").split()
            tree.differential = np.array(numbers(extra.text, len(words), f"{self.what}: {EXTENSION}"))
        return tree.arrange(self.what)

    def _place(self, name: str, seen: tuple[str, ...] = ()) -> Array:
        """T_model_frame of a link, joint or frame."""
        if name in ("", "__model__", "world"):
            return np.eye(4)
        if name not in self.frames:
            raise RoverError(f"{self.what}: frame {name!r} is not in the model")
        if name in seen or len(seen) > MAX_CHAIN:
            raise RoverError(
                f"{self.what}: frame {name!r} is placed relative to itself, or by way of more than {MAX_CHAIN} others"
            )
        if name not in self.placed:
            element = self.frames[name]
            pose = element.find("pose")
            base = "" if pose is None else pose.get("relative_to") or ""
            if not base and element.tag == "joint":
                base = (element.findtext("child") or "").strip()
            elif not base and element.tag == "frame":
                base = element.get("attached_to") or ""
            self.placed[name] = self._place(base, (*seen, name)) @ self._pose(element, name)
        return self.placed[name]

    def _pose(self, element: Element, where: str) -> Array:
        pose = element.find("pose")
        if pose is None:
            return np.eye(4)
        if pose.get("rotation_format", "euler_rpy") != "euler_rpy":
            raise RoverError(f"{self.what}: the pose of {where!r} is not in roll, pitch, yaw; write it so")
        values = numbers(pose.text, 6, f"{self.what}: pose of {where!r}", (0.0,) * 6)
        turn = np.radians(values[3:]) if pose.get("degrees") == "true" else values[3:]
        return place(values[:3], from_rpy(*turn))

    def _joint(self, element: Element) -> tuple[Joint, Array] | None:
        """The joint and its own frame in the model; None for one to the world."""
        name = element.get("name") or ""
        where = f"{self.what}: joint {name!r}"
        parent, child = ((element.findtext(end) or "").strip() for end in ("parent", "child"))
        if parent == "world":
            self.tree.notes.append(f"joint {name!r} ties it to the world; left out")
            return None
        kinds: dict[str, Literal["fixed", "hinge"]] = {"fixed": "fixed", "revolute": "hinge", "continuous": "hinge"}
        joint = Joint(name, kinds.get(element.get("type") or "", "other"), parent, child, np.eye(4))
        T = self._place(name)
        axis = element.find("axis")
        if joint.kind == "hinge":
            xyz = None if axis is None else axis.find("xyz")
            vector = np.array(numbers(None if xyz is None else xyz.text, 3, f"{where} axis", (0.0, 0.0, 1.0)))
            if (length := float(np.linalg.norm(vector))) < 1e-9:
                raise RoverError(f"{where} has an axis of no length")
            base = "" if xyz is None else xyz.get("expressed_in") or ""
            if axis is not None and (axis.findtext("use_parent_model_frame") or "").strip() in ("1", "true"):
                base = "__model__"
            joint.axis = (T[:3, :3].T @ self._place(base)[:3, :3] if base else np.eye(3)) @ (vector / length)
        if axis is not None:
            if (limit := axis.find("limit")) is not None and joint.kind == "hinge":
                low, high = (
                    numbers(limit.findtext(end), 1, f"{where} limit {end}", (far,), finite=False)[0]
                    for end, far in (("lower", -np.inf), ("upper", np.inf))
                )
                joint.limits = (low, high)
            if (mimic := axis.find("mimic")) is not None:
                factor, offset, reference = (
                    numbers(mimic.findtext(tag), 1, f"{where} mimic {tag}", (default,))[0]
                    for tag, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
                )
                joint.mimic = (mimic.get("joint") or "", factor, offset - factor * reference)
        return joint, T

    def _link(self, name: str, element: Element, T: Array) -> Part:
        """The link, seen from a frame in which its own stands at T."""
        where = f"{self.what}: link {name!r}"
        part = Part(name)
        inertial = element.find("inertial")
        if inertial is not None:
            M = T @ self._pose(inertial, f"{name} inertial")
            part.mass = numbers(inertial.findtext("mass"), 1, f"{where} mass", (1.0,))[0]
            if part.mass < 0:
                raise RoverError(f"{where} has a mass of {part.mass:g} kg; give 0 or more")
            given = inertial.find("inertia")
            six = [
                numbers(None if given is None else given.findtext(tag), 1, f"{where} {tag}", (1.0 if tag[1] == tag[2] else 0.0,))[
                    0
                ]
                for tag in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            ]
            own = np.array([[six[0], six[3], six[4]], [six[3], six[1], six[5]], [six[4], six[5], six[2]]])
            part.com, part.inertia = M[:3, 3], M[:3, :3] @ own @ M[:3, :3].T
        for use in ("collision", "visual"):
            for shape in element.findall(use):
                geometry = shape.find("geometry")
                if geometry is None or not len(geometry):
                    continue
                kind, S = geometry[0], T @ self._pose(shape, f"{name} {use}")
                tags = {
                    "box": (("size", 3),),
                    "cylinder": (("radius", 1), ("length", 1)),
                    "sphere": (("radius", 1),),
                    "ellipsoid": (("radii", 3),),
                }
                size: tuple[float, ...] = ()
                for tag, count in tags.get(kind.tag, ()):
                    size += numbers(kind.findtext(tag), count, f"{where} {kind.tag} {tag}")
                if size and min(size) < 0:
                    raise RoverError(f"{where} has a {kind.tag} of size {min(size):g}; give 0 or more")
                part.shapes.append(Shape(kind.tag if size else "mesh", size, S, shape.get("name", ""), use == "collision"))
        return part
