"""SDF (Gazebo's format) writer."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from ..model import Rover
from .export_tree import tree_of

VERSION = "1.11"
EXTENSION = "rockerbogie:differential"


def to_sdf(rover: Rover) -> str:
    """Return the rover as an SDF model.

    It has masses, collision cylinders, limits, and the differential as a `mimic` axis.

    A differential that is not a plain ratio is written as its slope at rest, and in full in `<rockerbogie:differential>`.

    Args:
        rover: the rover to write.

    Returns:
        SDF 1.11 text.

    Raises:
        RoverError: not a rover.
    """
    sdf = Element("sdf", {"version": VERSION, "xmlns:rockerbogie": "urn:rockerbogie"})
    sdf.append(model_element(rover))
    indent(sdf)
    return '<?xml version="1.0"?>\n' + tostring(sdf, encoding="unicode") + "\n"


def model_element(rover: Rover) -> Element:
    """Return the `<model>` element of a rover, to be put into a world.

    Args:
        rover: the rover to write.

    Returns:
        The element.
    """
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
            leader, (offset, multiplier) = joint.mimic
            mimic = SubElement(axis, "mimic", joint=leader)
            for name, value in (("multiplier", multiplier), ("offset", offset), ("reference", 0.0)):
                _leaf(mimic, name, value)
    return model


def _leaf(parent: Element, tag: str, *values: float) -> None:
    """Add an element with numbers that read back to the same bits."""
    SubElement(parent, tag).text = " ".join(repr(float(v) + 0.0) for v in values)
