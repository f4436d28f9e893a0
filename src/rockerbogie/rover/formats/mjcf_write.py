"""MJCF text with every number exact, where MuJoCo's own writer rounds to six digits."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, fromstring, tostring

import numpy as np


def exact_text(spec: Any) -> str:
    """Return a `mujoco.MjSpec` as MJCF text with exact numbers.

    Bodies, joints, shapes and equalities read back to the same bits.

    MuJoCo's own writer does the rest; it rounds to six digits, 1e-6 of a rover's length.

    Args:
        spec: a spec that compiles.

    Returns:
        MJCF text.
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
            ref = model.qpos0[model.jnt_qposadr[j]]
            _rewrite(joint, pos=model.jnt_pos[j], axis=model.jnt_axis[j], range=model.jnt_range[j], ref=ref)
        for g, geom in zip(geoms, body.findall("geom"), strict=True):
            _rewrite(geom, pos=model.geom_pos[g], quat=model.geom_quat[g], size=model.geom_size[g])
    for e, tie in enumerate(root.findall("equality/*")):
        _rewrite(tie, polycoef=model.eq_data[e])
    return tostring(root, encoding="unicode") + "\n"


def _rewrite(element: Element, **exact: Any) -> None:
    """Rewrite the attributes that an element has, with as many numbers as they have."""
    for key, values in exact.items():
        words = (element.get(key) or "").split()
        if words:
            element.set(key, " ".join(repr(float(v)) for v in np.atleast_1d(values)[: len(words)]))
