"""MJCF reader, through MuJoCo's own compiler.

Defaults, classes, units of angle and masses of shapes are therefore MuJoCo's.
"""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Any, Literal
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from ...arrays import Array
from ...errors import RoverError
from .meshes import MAX_BYTES, Mesh, MeshFolder
from .safe_xml import LARGEST, parse_xml
from .tree import Joint, Part, Shape, Tree, connected, place

#: Elements that the mechanism does not need: they may read other files, or refer to elements that did.
UNUSED = (
    "sensor", "keyframe", "actuator", "tendon", "contact", "extension", "custom", "deformable", "plugin", "statistic", "visual",
)  # fmt: skip
#: Assets other than meshes, body content built from other files, and equalities on elements that are taken out.
UNUSED_ASSETS = ("texture", "material", "hfield", "skin", "model")
FOREIGN = ("composite", "flexcomp", "attach", "replicate")
JOINT_TIES = ("joint", "connect", "weld")
#: A body with no mass but an unread mesh gets this mass (kg) from MuJoCo, and is read as having none.
LEAST = 1e-9
UNREAD = "rockerbogie_unread_"
#: Arrays of a compiled model that are read, and must be finite.
FINITE = (
    "body_pos", "body_quat", "body_mass", "body_ipos", "body_iquat", "body_inertia", "jnt_pos", "jnt_axis", "qpos0", "geom_pos",
    "geom_quat", "geom_size", "eq_data", "mesh_vert",
)  # fmt: skip
WORLD = "fused_with_world"


def read_mjcf(data: bytes | str, what: str = "model.xml", meshes: MeshFolder | None = None) -> list[Tree]:
    """Return the trees of an MJCF text, the largest first.

    If the rockers are joined to the world (MuJoCo fuses the root of a URDF with it), the body is a link `fused_with_world`.

    Args:
        data: the text.
        what: the file's name, for messages.
        meshes: reader of the mesh files it refers to; None: only meshes written in the file are read.

    Returns:
        The trees.

    Raises:
        RoverError: refused XML, or a model that MuJoCo refuses.
    """
    import mujoco

    root = parse_xml(data, what)
    if root.tag != "mujoco":
        raise RoverError(f"{what}: its root element is <{root.tag[:40]}>; an MJCF begins with <mujoco>")
    if any(element.tag == "include" for element in root.iter()):
        raise RoverError(f"{what}: it includes other files; save it as one (mujoco.MjSpec.from_file(...).to_xml())")
    if bad := next((f"{key}={value!r:.40}" for e in root.iter() for key, value in e.attrib.items() if _holds_nan(value)), ""):
        raise RoverError(f"{what}: {bad} is not finite")
    tree = Tree(root.get("model") or "rover", {}, {})
    assets = _prepare(root, tree, meshes or MeshFolder(None))
    _wrap_world(root, tree)
    try:
        model = mujoco.MjModel.from_xml_string(tostring(root, encoding="unicode"), assets)
    except (ValueError, mujoco.FatalError) as error:
        raise RoverError(f"{what}: MuJoCo refuses it: {' '.join(str(error).split())[:200]}") from None
    for field in FINITE:
        if not bool((np.abs(getattr(model, field)) <= LARGEST).all()):
            raise RoverError(f"{what}: MuJoCo reads a number in {field} that is not finite or above {LARGEST:g}")
    _Model(mujoco, model, tree).fill()
    return connected(tree, what, loops=True)


def _holds_nan(text: str) -> bool:
    """Return True if a text consists of numbers of which one is NaN.

    MuJoCo would write a log file for each.
    """
    words = text.lower().split()
    if not any("nan" in word for word in words):
        return False
    try:
        return any(np.isnan(float(word)) for word in words)
    except ValueError:
        return False


def _prepare(root: Element, tree: Tree, meshes: MeshFolder) -> dict[str, bytes]:
    """Remove everything that would read files from an MJCF; find its mesh files.

    Args:
        root: the <mujoco> element; changed.
        tree: gets the records of what was dropped.
        meshes: finder of mesh files.

    Returns:
        The contents of the mesh files that are kept, by the names they now have in the model.
    """
    folder = ""
    for compiler in root.iter("compiler"):
        folder = compiler.attrib.pop("meshdir", "") or compiler.attrib.pop("assetdir", "") or folder
        for key in ("assetdir", "texturedir", "strippath"):
            compiler.attrib.pop(key, None)
    kept: set[str | None] = set()
    files: dict[str, bytes] = {}
    for parent in root.iter():
        for child in list(parent):
            child.attrib.pop("material", None)
            if child.tag == "tendon" and parent is root:
                tree.dropped.setdefault("tendon", []).extend(e.get("name") or e.tag for e in child)
            foreign = child.tag in FOREIGN and parent.tag in ("body", "worldbody", "frame")
            if foreign:
                tree.drop(f"<{child.tag}>", child.get("name") or child.get("prefix") or "unnamed")
            tie = parent.tag == "equality" and child.tag not in JOINT_TIES
            asset = parent.tag == "asset" and child.tag in UNUSED_ASSETS
            if child.tag in UNUSED or foreign or tie or asset or (child.tag == "geom" and child.get("hfield")):
                parent.remove(child)
            elif parent.tag == "asset" and child.tag == "mesh":
                name, file = child.get("name"), child.get("file")
                address = str(PurePosixPath(folder, file)) if file and "://" not in file else file
                if address is not None:
                    name = name or PurePosixPath(address).stem
                    child.set("name", name)
                    path = meshes.find(address)
                    if path is None or path.stat().st_size > MAX_BYTES:
                        tree.unread.append(f"{address}: not found beside the robot file")
                        parent.remove(child)
                        continue
                    child.set("file", f"mesh_{len(files)}{path.suffix.lower()}")
                    files[child.get("file") or ""] = path.read_bytes()
                kept.add(name)
    _replace_unread(root, tree, kept)
    return files


def _replace_unread(root: Element, tree: Tree, kept: set[str | None]) -> None:
    """Replace geoms whose mesh is missing by small spheres that keep their mass."""
    count = 0
    for body in (element for element in root.iter() if element.tag in ("worldbody", "body", "frame")):
        for geom in body.findall("geom"):
            mesh = geom.get("mesh")
            if mesh is None or mesh in kept:
                continue
            if not any(entry.startswith(mesh) or f"/{mesh}." in entry for entry in tree.unread):
                tree.unread.append(f"{mesh}: not in the file's assets")
            if body.find("inertial") is None and geom.get("mass") is None:
                tree.drop("mass of a mesh that was not read", body.get("name") or body.tag)
            for key in ("mesh", "fitscale", "size", "fromto", "density", "shellinertia"):
                geom.attrib.pop(key, None)
            geom.set("type", "sphere")
            geom.set("size", "1e-3")
            geom.set("mass", geom.get("mass") or "0")
            geom.set("name", f"{UNREAD}{count}")
            count += 1
    if count:
        for compiler in root.findall("compiler") or [SubElement(root, "compiler")]:
            compiler.set("boundmass", repr(LEAST))
            compiler.set("boundinertia", "1e-15")


def _wrap_world(root: Element, tree: Tree) -> None:
    """Put the world's own shapes, and the bodies that turn on the world, into a body.

    This happens only if there are two such bodies or more.
    """
    world = root.find("worldbody")
    if world is None:
        return
    turning = [body for body in world.findall("body") if any(j.get("type", "hinge") == "hinge" for j in body.findall("joint"))]
    if len(turning) < 2:
        return
    base = Element("body", name=WORLD)
    shapes = [geom for geom in world.findall("geom") if geom.get("type") not in ("plane", "hfield")]
    for element in (*turning, *shapes):
        world.remove(element)
        base.append(element)
    world.append(base)
    tree.notes.append("its rockers turn on the world (MuJoCo fuses a root link with it): the world's own shapes are the body")
    stated = [geom for geom in shapes if {"mass", "density", "class"} & geom.attrib.keys()]
    if not stated:
        tree.drop("mass of the body, lost when its link was fused with the world", WORLD)
        for geom in shapes:
            geom.set("mass", "0")


class _Model:
    """A compiled model, read into a tree."""

    def __init__(self, mujoco: Any, model: Any, tree: Tree) -> None:
        self.mujoco, self.model, self.tree = mujoco, model, tree
        geom = mujoco.mjtGeom
        self.kinds = {
            int(geom.mjGEOM_CYLINDER): "cylinder",
            int(geom.mjGEOM_BOX): "box",
            int(geom.mjGEOM_SPHERE): "sphere",
            int(geom.mjGEOM_ELLIPSOID): "ellipsoid",
            int(geom.mjGEOM_CAPSULE): "capsule",
            int(geom.mjGEOM_MESH): "mesh",
        }

    def name(self, kind: Any, i: int) -> str:
        """Return the name of a body or joint; one made of its number if it has none."""
        label = "body" if kind == self.mujoco.mjtObj.mjOBJ_BODY else "joint"
        return self.mujoco.mj_id2name(self.model, kind, i) or f"{label}_{i}"

    def fill(self) -> None:
        """Add bodies as links, their joints, and the equalities between joints."""
        for b in range(1, self.model.nbody):
            self._body(b)
        # a body that only the world carries is a root
        self.tree.joints = {n: j for n, j in self.tree.joints.items() if j.parent in self.tree.parts}
        for e in range(self.model.neq):
            self._equality(e)

    def _body(self, b: int) -> None:
        """Add a body, its shapes and the joints that carry it."""
        model, body_kind = self.model, self.mujoco.mjtObj.mjOBJ_BODY
        body, parent = self.name(body_kind, b), int(model.body_parentid[b])
        T = place(model.body_pos[b], self._rotation(model.body_quat[b]))
        above = "" if parent == 0 else self.name(body_kind, parent)
        hinge, free = int(self.mujoco.mjtJoint.mjJNT_HINGE), int(self.mujoco.mjtJoint.mjJNT_FREE)
        joints = [
            j for j in range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b]) if model.jnt_type[j] != free
        ]
        for k, j in enumerate(joints):
            last = k == len(joints) - 1
            link = body if last else f"{body}__{k}"
            self._joint(j, model.jnt_type[j] == hinge, above, link, T)
            if not last:
                self.tree.parts[link] = Part(link)
            above, T = link, np.eye(4)
        if parent and not joints:
            self.tree.joints[f"{body}_fixed"] = Joint(f"{body}_fixed", "fixed", above, body, T)
        R, mass = self._rotation(model.body_iquat[b]), float(model.body_mass[b])
        part = Part(body) if mass <= LEAST else Part(body, mass, np.array(model.body_ipos[b]), (R * model.body_inertia[b]) @ R.T)
        self.tree.parts[body] = part
        for g in range(model.body_geomadr[b], model.body_geomadr[b] + model.body_geomnum[b]):
            if (shape := self._shape(g)) is not None:
                part.shapes.append(shape)

    def _joint(self, j: int, hinge: bool, parent: str, child: str, T: Array) -> None:
        """Add a joint. Its angle is counted from the pose in the file, where MuJoCo's reads `ref`."""
        model, tree = self.model, self.tree
        name = self.name(self.mujoco.mjtObj.mjOBJ_JOINT, j)
        kind: Literal["hinge", "other"] = "hinge" if hinge else "other"
        joint = Joint(name, kind, parent, child, T, anchor=np.array(model.jnt_pos[j]))
        if hinge:
            joint.axis = np.array(model.jnt_axis[j])
            if model.jnt_limited[j]:
                low, high = (float(v) - float(model.qpos0[model.jnt_qposadr[j]]) for v in model.jnt_range[j])
                joint.limits = (low, high)
        else:
            label = {int(self.mujoco.mjtJoint.mjJNT_SLIDE): "slide"}.get(int(model.jnt_type[j]), "ball")
            tree.drop(f"motion of a {label} joint, held at rest", name)
        dof = int(model.jnt_dofadr[j])
        if np.any(model.jnt_stiffness[j]):
            tree.drop("joint spring", name)
        for key in ("damping", "frictionloss", "armature"):
            if np.any(getattr(model, f"dof_{key}")[dof]):
                tree.drop(f"joint {key}", name)
        tree.joints[name] = joint

    def _shape(self, g: int) -> Shape | None:
        """Return the shape of a geom; None for planes and height fields."""
        model = self.model
        kind = self.kinds.get(int(model.geom_type[g]))
        if kind is None:
            return None
        collides = bool(model.geom_contype[g] or model.geom_conaffinity[g])
        T = place(model.geom_pos[g], self._rotation(model.geom_quat[g]))
        a, b, c = (float(v) for v in model.geom_size[g])
        size = {
            "cylinder": (a, 2 * b),
            "capsule": (a, 2 * b),
            "sphere": (a,),
            "box": (2 * a, 2 * b, 2 * c),
            "ellipsoid": (a, b, c),
            "mesh": (),
        }[kind]
        if (self.mujoco.mj_id2name(model, self.mujoco.mjtObj.mjOBJ_GEOM, g) or "").startswith(UNREAD):
            return Shape("mesh", (), T, f"geom {g}", collides)
        mesh = None
        if kind == "mesh":
            first, count = model.mesh_vertadr[model.geom_dataid[g]], model.mesh_vertnum[model.geom_dataid[g]]
            mesh = Mesh(np.array(model.mesh_vert[first : first + count], dtype=float))
        return Shape(kind, size, T, f"geom {g}", collides, mesh)

    def _equality(self, e: int) -> None:
        """Make the follower of an active joint equality mimic its leader.

        Other equalities are recorded as dropped.
        """
        model, tree, tie = self.model, self.tree, self.mujoco.mjtEq
        label = self.mujoco.mj_id2name(model, self.mujoco.mjtObj.mjOBJ_EQUALITY, e) or f"equality {e}"
        if not model.eq_active0[e]:
            tree.drop("inactive equality", label)
            return
        if model.eq_type[e] != tie.mjEQ_JOINT:
            tree.drop("loop closed by a connect or weld equality", label)
            return
        joint = self.mujoco.mjtObj.mjOBJ_JOINT
        follower = self.name(joint, int(model.eq_obj1id[e]))
        c = tuple(float(v) for v in np.trim_zeros(np.array(model.eq_data[e][:5]), "b")) or (0.0,)
        if follower not in tree.joints or tree.joints[follower].mimic is not None:
            tree.drop("second equality of a joint", label)
        elif model.eq_obj2id[e] < 0 or len(c) == 1:
            tree.joints[follower].limits = (c[0], c[0])
        else:
            tree.joints[follower].mimic = (self.name(joint, int(model.eq_obj2id[e])), c)

    def _rotation(self, quat: Array) -> Array:
        """Return the rotation (3, 3) of MuJoCo's quaternion (w, x, y, z)."""
        R = np.zeros(9)
        self.mujoco.mju_quat2Mat(R, quat)
        return R.reshape(3, 3)
