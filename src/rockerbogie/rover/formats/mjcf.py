"""MJCF in, through MuJoCo's own compiler, so that defaults, classes and units of angle are its own; out, to the last digit."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, fromstring, tostring

import numpy as np
from numpy.typing import NDArray

from ...errors import RoverError
from .safe_xml import parse_xml
from .tree import Joint, Part, Shape, Tree, place

Array = NDArray[np.float64]

#: What the mechanism does without: it may read other files, or lean on what did.
SPARE = ("asset", "sensor", "keyframe", "actuator", "tendon", "contact", "extension", "custom")


def read_mjcf(data: bytes | str, what: str = "model.xml") -> Tree:
    """The kinematic tree of an MJCF text.

    Raises:
        RoverError: XML that is refused, or a model that MuJoCo refuses.
    """
    import mujoco

    root = parse_xml(data, what)
    if root.tag != "mujoco":
        raise RoverError(f"{what}: its root element is <{root.tag[:40]}>; an MJCF begins with <mujoco>")
    if any(element.tag == "include" for element in root.iter()):
        raise RoverError(f"{what}: it includes other files; save it as one (mujoco.MjSpec.from_file(...).to_xml())")
    _strip(root)
    try:
        model = mujoco.MjModel.from_xml_string(tostring(root, encoding="unicode"))
    except (ValueError, mujoco.FatalError) as error:
        raise RoverError(f"{what}: MuJoCo refuses it: {' '.join(str(error).split())[:200]}") from None
    return _tree(model, mujoco, root.get("model") or "rover", what)


def _strip(root: Element) -> None:
    """Take out what would read other files, and what leans on it."""
    for parent in root.iter():
        for child in list(parent):
            if child.tag in SPARE or (child.tag == "geom" and (child.get("mesh") or child.get("hfield"))):
                parent.remove(child)
            child.attrib.pop("material", None)


def _tree(model: Any, mujoco: Any, name: str, what: str) -> Tree:
    tree = Tree(name, {}, {})
    kinds = {mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder", mujoco.mjtGeom.mjGEOM_BOX: "box", mujoco.mjtGeom.mjGEOM_SPHERE: "sphere"}
    kinds[mujoco.mjtGeom.mjGEOM_ELLIPSOID] = "ellipsoid"
    hinge, free = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_FREE)

    def called(kind: Any, i: int) -> str:
        return mujoco.mj_id2name(model, kind, i) or f"{'body' if kind == mujoco.mjtObj.mjOBJ_BODY else 'joint'}_{i}"

    shift: dict[int, Array] = {}  # T_part_body: a part's frame stands at its body's last hinge
    for b in range(1, model.nbody):
        body, parent = called(mujoco.mjtObj.mjOBJ_BODY, b), int(model.body_parentid[b])
        at, turn = place(model.body_pos[b], _rotation(mujoco, model.body_quat[b])), np.zeros(3)
        joints = range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b])
        above = called(mujoco.mjtObj.mjOBJ_BODY, parent)
        T = shift.get(parent, np.eye(4)) @ at  # T_above_body
        for k, j in enumerate(joints):
            if model.jnt_type[j] == free:
                continue
            last = k == len(joints) - 1
            link = body if last else f"{body}__{k}"
            point = model.jnt_pos[j]
            joint = Joint(
                called(mujoco.mjtObj.mjOBJ_JOINT, j),
                "hinge" if model.jnt_type[j] == hinge else "other",
                above,
                link,
                T @ place(point - turn),
            )
            if joint.kind == "hinge":
                joint.axis = np.array(model.jnt_axis[j])
                joint.limits = tuple(float(v) for v in model.jnt_range[j]) if model.jnt_limited[j] else None  # type: ignore[assignment]
            tree.joints[joint.name] = joint
            if not last:
                tree.parts[link] = Part(link)
            above, T, turn = link, np.eye(4), np.array(point)
        if parent and not len(joints):
            tree.joints[f"{body}_fixed"] = Joint(f"{body}_fixed", "fixed", above, body, T)
        shift[b] = place(-turn)
        R = _rotation(mujoco, model.body_iquat[b])
        part = tree.parts[body] = Part(
            body, float(model.body_mass[b]), model.body_ipos[b] - turn, (R * model.body_inertia[b]) @ R.T
        )
        for g in range(model.body_geomadr[b], model.body_geomadr[b] + model.body_geomnum[b]):
            kind = kinds.get(mujoco.mjtGeom(model.geom_type[g]))
            if kind is None:
                continue
            size = [float(v) for v in model.geom_size[g]]
            sizes = {
                "cylinder": (size[0], 2 * size[1]),
                "sphere": (size[0],),
                "box": tuple(2 * v for v in size),
                "ellipsoid": tuple(size),
            }
            collides = bool(model.geom_contype[g] or model.geom_conaffinity[g])
            part.shapes.append(
                Shape(
                    kind,
                    sizes[kind],
                    place(model.geom_pos[g] - turn, _rotation(mujoco, model.geom_quat[g])),
                    f"geom {g}",
                    collides,
                )
            )
    tree.joints = {n: j for n, j in tree.joints.items() if j.parent in tree.parts}  # what hangs on the world is a root
    for e in range(model.neq):
        if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[e] >= 0:
            follower, leader = (called(mujoco.mjtObj.mjOBJ_JOINT, int(i[e])) for i in (model.eq_obj1id, model.eq_obj2id))
            c = np.trim_zeros(np.array(model.eq_data[e][:5]), "b")
            if follower in tree.joints and leader in tree.joints and len(c) > 1:
                tree.joints[follower].mimic = (leader, float(c[1]), float(c[0]))
                if len(c) > 2:
                    tree.differential = c
    return tree.arrange(what)


def _rotation(mujoco: Any, quat: Array) -> Array:
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quat)
    return R.reshape(3, 3)


def exact_text(spec: Any) -> str:
    """A compiled `mujoco.MjSpec` as MJCF text whose bodies, joints, shapes and ties read back to the same bits.

    MuJoCo's own writer, which does the rest, rounds to six digits: 1e-6 of a rover's length.
    """
    model = spec.compile()
    root = fromstring(spec.to_xml())
    world = root.find("worldbody")
    bodies = [] if world is None else [world, *world.iter("body")]
    for b, body in enumerate(bodies):
        joints = range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b])
        geoms = range(model.body_geomadr[b], model.body_geomadr[b] + model.body_geomnum[b])
        if b:
            _rewrite(body, pos=model.body_pos[b], quat=model.body_quat[b])
        for inertial in body.findall("inertial"):
            _rewrite(
                inertial,
                pos=model.body_ipos[b],
                quat=model.body_iquat[b],
                mass=model.body_mass[b],
                diaginertia=model.body_inertia[b],
            )
        for j, joint in zip(joints, body.findall("joint"), strict=True):
            _rewrite(joint, pos=model.jnt_pos[j], axis=model.jnt_axis[j], range=model.jnt_range[j])
        for g, geom in zip(geoms, body.findall("geom"), strict=True):
            _rewrite(geom, pos=model.geom_pos[g], quat=model.geom_quat[g], size=model.geom_size[g])
    for e, tie in enumerate(root.findall("equality/*")):
        _rewrite(tie, polycoef=model.eq_data[e])
    return tostring(root, encoding="unicode") + "\n"


def _rewrite(element: Element, **exact: Any) -> None:
    """Write the attributes that are there anew, with as many numbers as they have."""
    for key, values in exact.items():
        words = (element.get(key) or "").split()
        if words:
            element.set(key, " ".join(repr(float(v)) for v in np.atleast_1d(values)[: len(words)]))
