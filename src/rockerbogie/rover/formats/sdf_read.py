"""SDF (Gazebo's format) reader.

It reads every model of the file, nested ones included, as libsdformat resolves it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from ...arrays import Array
from ...errors import RoverError
from .meshes import MeshFolder
from .safe_xml import numbers, parse_xml
from .sdf_write import EXTENSION, SYSTEM
from .tree import Joint, Part, Shape, Tree, connected, from_rpy, inverse, place

#: Frames may be placed relative to one another so many deep.
MAX_CHAIN = 100
#: From these versions on: joint axes are given in the joint's frame; `relative_to` stands for `frame`.
AXIS_IN_JOINT, RELATIVE_TO = (1, 5), (1, 7)
KINDS: dict[str, Literal["fixed", "hinge"]] = {"fixed": "fixed", "revolute": "hinge", "continuous": "hinge"}
SIZES = {
    "box": (("size", 3),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
    "sphere": (("radius", 1),),
    "ellipsoid": (("radii", 3),),
}
#: Density of a link with `<inertial auto="true">` that states none, kg/m³.
DENSITY = 1000.0


def read_sdf(data: bytes | str, what: str = "model.sdf", meshes: MeshFolder | None = None) -> list[Tree]:
    """Return the trees of all models of an SDF text, the largest first.

    Args:
        data: the text.
        what: the file's name, for messages.
        meshes: reader of the mesh files it refers to; None: meshes are not read.

    Returns:
        The trees.

    Raises:
        RoverError: refused XML, or a faulty description.
    """
    root = parse_xml(data, what)
    models = [model for holder in (root, *root.findall("world")) for model in holder.findall("model")]
    if root.tag != "sdf" or not models:
        included = root.find(".//include") is not None
        remedy = "; it only includes others: expand it with `gz sdf -p`" if included else ""
        raise RoverError(f"{what}: an SDF begins with <sdf> and holds a <model>; here it begins with <{root.tag[:40]}>{remedy}")
    version = _version(root.get("version"), what)
    trees, complaint = [], None
    for model in models:
        try:
            trees += _Model(model, what, version, meshes or MeshFolder(None)).read()
        except RoverError as error:
            complaint = complaint or error
    if complaint is not None and not trees:
        raise complaint
    return sorted(trees, key=lambda tree: -len(tree.parts))


def _version(text: str | None, what: str) -> tuple[int, int]:
    """Return the version of an SDF as numbers; the newest if none is stated."""
    words = (text or "1.11").split(".")
    if len(words) != 2 or not all(w.isascii() and w.isdigit() and len(w) < 4 for w in words):
        raise RoverError(f"{what}: SDF version {text!r:.30} is not two numbers, as in 1.9")
    version = (int(words[0]), int(words[1]))
    if not (1, 3) <= version < (2, 0):
        raise RoverError(f"{what}: SDF version {text} is not read; convert it to 1.4 or later: `gz sdf -p {what}`")
    return version


@dataclass
class _Frame:
    """Named frame: a link, joint, frame or model, and the scope (prefix) of its model."""

    element: Element
    scope: str
    kind: str


class _Model:
    """Reader of a `<model>` and the models nested in it.

    Each pose may be given in any other frame of it.
    """

    def __init__(self, model: Element, what: str, version: tuple[int, int], meshes: MeshFolder) -> None:
        self.model, self.what, self.version, self.meshes = model, what, version, meshes
        self.tree = Tree(model.get("name") or "rover", {}, {})
        self.frames: dict[str, _Frame] = {}
        self.placed: dict[str, Array] = {}
        self._collect(model, "", 0)

    def _collect(self, model: Element, scope: str, depth: int) -> None:
        """Register the frames of a model under its scope ("" or "outer::inner::")."""
        if depth > MAX_CHAIN:
            raise RoverError(f"{self.what}: models are nested more than {MAX_CHAIN} deep")
        for element in model:
            if element.tag == "include":
                self.tree.drop("<include> (expand it with `gz sdf -p`)", (element.findtext("uri") or "?").strip()[:60])
            if element.tag not in ("link", "joint", "frame", "model"):
                continue
            name = element.get("name")
            if not name:
                raise RoverError(f"{self.what}: a <{element.tag}> has no name")
            if scope + name in self.frames:
                raise RoverError(f"{self.what}: two parts are called {scope + name!r}")
            self.frames[scope + name] = _Frame(element, scope, element.tag)
            if element.tag == "model":
                self._collect(element, f"{scope}{name}::", depth + 1)

    def read(self) -> list[Tree]:
        """Return the connected trees of the model."""
        tree = self.tree
        links = {name: frame for name, frame in self.frames.items() if frame.kind == "link"}
        if not links:
            raise RoverError(f"{self.what}: model {tree.name!r} holds no link")
        for name, frame in links.items():
            tree.parts[name] = self._link(name, frame.element)
        for name, frame in self.frames.items():
            if frame.kind == "joint" and (joint := self._joint(name, frame)) is not None:
                tree.joints[name] = joint
        extra = self.model.find(EXTENSION)
        if extra is not None:
            words = (extra.text or "").split()
            tree.differential = np.array(numbers(extra.text, len(words), f"{self.what}: {EXTENSION}"))
        for plugin in self.model.findall("plugin"):
            left, right = (plugin.findtext(side) or "" for side in ("left", "right"))
            if plugin.findtext("module_name") == SYSTEM and {left, right} <= tree.joints.keys():
                tree.joints[right].mimic = (left, (0.0, -1.0))  # the polynomial itself is in `EXTENSION`
        tree.unread = [f"{address}: {reason}" for address, reason in self.meshes.failed.items()]
        return connected(tree, self.what, loops=True)

    def _scoped(self, name: str, scope: str, user: str) -> str:
        """Return the full name of a frame named inside a scope.

        The scope's own model is "scope::__model__".
        """
        if name == "__model__":
            return f"{scope}__model__"
        if scope + name not in self.frames:
            raise RoverError(f"{self.what}: {user} names {name!r}, which is no frame of the model")
        return scope + name

    def _link_of(self, name: str, scope: str, user: str) -> str:
        """Return the link that a frame, joint or nested model is attached to, as joints to it are."""
        full = self._scoped(name, scope, user)
        for _ in range(MAX_CHAIN):
            if full.endswith("__model__"):
                full = self._canonical(full.removesuffix("__model__"), user)
            frame = self.frames[full]
            if frame.kind == "link":
                return full
            if frame.kind == "model":
                full = f"{full}::__model__"
            elif frame.kind == "joint":
                full = self._scoped((frame.element.findtext("child") or "").strip(), frame.scope, f"joint {full!r}")
            else:
                full = self._scoped(frame.element.get("attached_to") or "__model__", frame.scope, f"frame {full!r}")
        raise RoverError(f"{self.what}: frame {name!r} is attached to itself, or by way of more than {MAX_CHAIN} others")

    def _canonical(self, scope: str, user: str) -> str:
        """Return the canonical link of the model with this scope: the one it names, or its first."""
        model = self.frames[scope.removesuffix("::")].element if scope else self.model
        named = model.get("canonical_link")
        if named and scope + named in self.frames:
            return scope + named
        first = next((name for name, f in self.frames.items() if f.kind == "link" and name.startswith(scope)), None)
        if first is None:
            raise RoverError(f"{self.what}: {user} names a model that holds no link")
        return first

    def _place(self, name: str, seen: tuple[str, ...] = ()) -> Array:
        """Return T_top_frame (4, 4) of a frame by its full name, in the top model's frame."""
        if name == "__model__":
            return np.eye(4)
        if name.endswith("::__model__"):
            name = name.removesuffix("::__model__")
        if name in self.placed:
            return self.placed[name]
        if name in seen or len(seen) > MAX_CHAIN:
            raise RoverError(
                f"{self.what}: frame {name!r} is placed relative to itself, or by way of more than {MAX_CHAIN} others"
            )
        frame, path = self.frames[name], (*seen, name)
        pose = frame.element.find("pose")
        base = "" if pose is None else self._relative_to(pose)
        if not base and frame.kind == "joint":
            base = (frame.element.findtext("child") or "").strip()
        elif not base and frame.kind == "frame":
            base = frame.element.get("attached_to") or ""
        outer = self._scoped(base or "__model__", frame.scope, f"the pose of {name!r}")
        T = self._place(outer, path) @ self._pose(frame.element, name)
        placement = frame.element.get("placement_frame")
        if frame.kind == "model" and placement:
            T = T @ inverse(self._inside(name, placement, path))
        self.placed[name] = T
        return self.placed[name]

    def _inside(self, model: str, frame: str, path: tuple[str, ...]) -> Array:
        """Return T_model_frame (4, 4) of a frame of a nested model, without the model's own pose."""
        self.placed[model] = np.eye(4)
        inside = self._place(self._scoped(frame, f"{model}::", f"placement_frame of {model!r}"), path)
        self.placed = {name: T for name, T in self.placed.items() if not (name + "::").startswith(f"{model}::")}
        return inside

    def _relative_to(self, pose: Element) -> str:
        """Return the name of the frame that a pose is given in; "" for the default."""
        return pose.get("relative_to" if self.version >= RELATIVE_TO else "frame") or ""

    def _pose(self, element: Element, where: str) -> Array:
        """Return the transform (4, 4) of an element's <pose>; identity if it has none."""
        pose = element.find("pose")
        if pose is None:
            return np.eye(4)
        degrees = pose.get("degrees") == "true"
        if pose.get("rotation_format", "euler_rpy") == "quat_xyzw":
            values = numbers(pose.text, 7, f"{self.what}: pose of {where!r}")
            return place(values[:3], _from_quaternion(np.array(values[3:]), f"{self.what}: pose of {where!r}"))
        values = numbers(pose.text, 6, f"{self.what}: pose of {where!r}", (0.0,) * 6)
        return place(values[:3], from_rpy(*(np.radians(values[3:]) if degrees else values[3:])))

    def _joint(self, name: str, frame: _Frame) -> Joint | None:
        """Return a joint between links; None for one to the world."""
        element, where = frame.element, f"{self.what}: joint {name!r}"
        parent, child = ((element.findtext(end) or "").strip() for end in ("parent", "child"))
        if "world" in (parent, child):
            self.tree.drop("joint to the world", name)
            return None
        for end, value in (("parent", parent), ("child", child)):
            if not value:
                raise RoverError(f"{where} names no {end} link")
        links = [self._link_of(end, frame.scope, f"joint {name!r}") for end in (parent, child)]
        if links[0] == links[1]:
            raise RoverError(f"{where} joins link {links[0]!r} to itself")
        T, T_child = self._place(name), self._place(links[1])
        joint = Joint(
            name, KINDS.get(element.get("type") or "", "other"), links[0], links[1], inverse(self._place(links[0])) @ T_child
        )
        in_child = inverse(T_child) @ T
        joint.anchor = in_child[:3, 3]
        axis = element.find("axis")
        if joint.kind == "other" and element.get("type") not in ("ball", "universal"):
            self.tree.drop(f"motion of a {element.get('type')!s:.20} joint, held at rest", name)
        if joint.kind == "hinge":
            self._axis(joint, axis, frame.scope, T, T_child, where)
        if axis is not None:
            self._axis_properties(joint, axis, frame.scope, where)
        return joint

    def _axis(self, joint: Joint, axis: Element | None, scope: str, T: Array, T_child: Array, where: str) -> None:
        """Set a hinge's axis.

        It is given in the joint's frame, the model's (SDF 1.4 and older, or on request), or a named one.
        """
        xyz = None if axis is None else axis.find("xyz")
        vector = np.array(numbers(None if xyz is None else xyz.text, 3, f"{where} axis", (0.0, 0.0, 1.0)))
        if (length := float(np.linalg.norm(vector))) < 1e-9:
            raise RoverError(f"{where} has an axis of no length")
        base = "" if xyz is None else xyz.get("expressed_in") or ""
        asked = "" if axis is None else (axis.findtext("use_parent_model_frame") or "").strip()
        if asked in ("1", "true") or (not asked and self.version < AXIS_IN_JOINT and axis is not None):
            base = "__model__"
        R = self._place(self._scoped(base, scope, where))[:3, :3] if base else T[:3, :3]
        joint.axis = T_child[:3, :3].T @ R @ (vector / length)

    def _axis_properties(self, joint: Joint, axis: Element, scope: str, where: str) -> None:
        """Set a joint's limits and mimic; record springs, damping and friction as dropped."""
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
            joint.mimic = (scope + (mimic.get("joint") or ""), (offset - factor * reference, factor))
        for tag, kind in (("damping", "damping"), ("friction", "friction"), ("spring_stiffness", "spring")):
            if numbers(axis.findtext(f"dynamics/{tag}"), 1, f"{where} {tag}", (0.0,))[0]:
                self.tree.drop(f"joint {kind}", joint.name)

    def _link(self, name: str, element: Element) -> Part:
        """Return a link with its mass properties and shapes, in its own frame."""
        where = f"{self.what}: link {name!r}"
        part = Part(name)
        densities = []
        for use in ("collision", "visual"):
            for shape in element.findall(use):
                geometry = shape.find("geometry")
                if geometry is None or not len(geometry):
                    continue
                part.shapes.append(self._shape(geometry[0], shape, where, use, name))
                if use == "collision":
                    densities.append(shape.findtext("density"))
        inertial = element.find("inertial")
        if inertial is not None and inertial.get("auto") == "true":
            self._auto_inertial(part, inertial, densities, where)
        elif inertial is not None:
            M = self._pose(inertial, f"{name} inertial")
            part.mass = numbers(inertial.findtext("mass"), 1, f"{where} mass", (1.0,))[0]
            if part.mass < 0:
                raise RoverError(f"{where} has a mass of {part.mass:g} kg; give 0 or more")
            given = inertial.find("inertia")
            xx, yy, zz, xy, xz, yz = (
                numbers(None if given is None else given.findtext(k), 1, f"{where} {k}", (1.0 if k[1] == k[2] else 0.0,))[0]
                for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            )
            own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            part.com, part.inertia = M[:3, 3], M[:3, :3] @ own @ M[:3, :3].T
        return part

    def _auto_inertial(self, part: Part, inertial: Element, densities: list[str | None], where: str) -> None:
        """Set a link's mass properties from its collision shapes' densities (SDF 1.11 `auto`)."""
        default = numbers(inertial.findtext("density"), 1, f"{where} density", (DENSITY,))[0]
        pieces = []
        for shape, text in zip([s for s in part.shapes if s.collides], densities, strict=True):
            if shape.unread:
                self.tree.drop("mass of a collision mesh that was not read", part.name)
            pieces.append(shape.mass_properties(numbers(text, 1, f"{where} density", (default,))[0]))
        part.mass = float(sum(m for m, _, _ in pieces))
        if part.mass > 0:
            part.com = np.asarray(sum(m * c for m, c, _ in pieces) / part.mass)
            for m, c, own in pieces:
                d = c - part.com
                part.inertia = part.inertia + own + m * (np.eye(3) * (d @ d) - np.outer(d, d))

    def _shape(self, kind: Element, element: Element, where: str, use: str, link: str) -> Shape:
        """Return a collision or visual shape."""
        T, name, collides = self._pose(element, f"{link} {use}"), element.get("name", ""), use == "collision"
        if kind.tag == "mesh":
            scale = np.array(numbers(kind.findtext("scale"), 3, f"{where} mesh scale", (1.0, 1.0, 1.0)))
            mesh = self.meshes.load((kind.findtext("uri") or "").strip())
            return Shape("mesh", (), T, name, collides, None if mesh is None else mesh.scaled(scale))
        size: tuple[float, ...] = ()
        for tag, count in SIZES.get(kind.tag, ()):
            size += numbers(kind.findtext(tag), count, f"{where} {kind.tag} {tag}")
        if size and min(size) < 0:
            raise RoverError(f"{where} has a {kind.tag} of size {min(size):g}; give 0 or more")
        return Shape(kind.tag if size else "mesh", size, T, name, collides)


def _from_quaternion(q: Array, where: str) -> Array:
    """Return the rotation (3, 3) of a quaternion (x, y, z, w)."""
    if (length := float(np.linalg.norm(q))) < 1e-9:
        raise RoverError(f"{where} has a quaternion of no length")
    x, y, z, w = q / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
