"""SDF (Gazebo's format) writer."""

from __future__ import annotations

from importlib.resources import files
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from ...errors import RockerbogieError
from ..model import Rover
from .export_tree import differential_inertia, tree_of

#: The differential as a constraint that some engines honour, or as a Gazebo system that works on each.
Coupling = Literal["mimic", "system"]
VERSION = "1.11"
EXTENSION = "rockerbogie:differential"
#: Name spaces of the elements of this package and of Drake.
NAMESPACES = {"xmlns:rockerbogie": "urn:rockerbogie", "xmlns:drake": "http://drake.mit.edu"}
#: Name of the module with the Gazebo system, and its loader.
SYSTEM = "rockerbogie_differential"
LOADER = {"filename": "gz-sim-python-system-loader-system", "name": "gz::sim::systems::PythonSystemLoader"}


def to_sdf(rover: Rover, *, differential: Coupling = "mimic") -> str:
    """Return the rover as an SDF model.

    It has masses, collision cylinders, limits, and the differential, which engines honour in different ways (docs/formats.md).

    "mimic" is a `mimic` axis, for Gazebo with bullet-featherstone, and `drake:mimic`, for Drake. Gazebo's default engine, DART,
    does not honour it: there, the rockers turn freely. A differential that is not a plain ratio is written as its slope at
    rest, and in full in `<rockerbogie:differential>`. "system" is a Gazebo system for every engine, with the full differential;
    `differential_system()` returns the file that must lie beside the SDF.

    Args:
        rover: the rover to write.
        differential: "mimic" or "system".

    Returns:
        SDF 1.11 text.

    Raises:
        RoverError: not a rover.
        RockerbogieError: another kind of differential.
    """
    sdf = Element("sdf", {"version": VERSION} | NAMESPACES)
    sdf.append(model_element(rover, differential))
    indent(sdf)
    return '<?xml version="1.0"?>\n' + tostring(sdf, encoding="unicode") + "\n"


def differential_system() -> tuple[str, str]:
    """Return the Gazebo system of the differential, for gz sim 8 (Harmonic) or newer.

    Returns:
        File name, and Python source.
    """
    source = files(__package__).joinpath("gazebo_differential.py").read_text(encoding="utf-8")
    return f"{SYSTEM}.py", source


def model_element(rover: Rover, differential: Coupling = "mimic") -> Element:
    """Return the `<model>` element of a rover, to be put into a world.

    Args:
        rover: the rover to write.
        differential: as `to_sdf`.

    Returns:
        The element.

    Raises:
        RoverError: not a rover.
        RockerbogieError: another kind of differential.
    """
    if differential not in ("mimic", "system"):
        raise RockerbogieError(f"differential {differential!r} is not known; give 'mimic' or 'system'")
    tree = tree_of(rover)
    rest = tree.rest()
    model = Element("model", name=tree.name)
    if tree.differential is not None or differential == "system":
        _leaf(model, EXTENSION, *rover.differential)
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
        if joint.mimic is not None and differential == "mimic":
            leader, (offset, multiplier) = joint.mimic
            mimic = SubElement(axis, "mimic", joint=leader)
            for name, value in (("multiplier", multiplier), ("offset", offset), ("reference", 0.0)):
                _leaf(mimic, name, value)
            attributes = {"joint": leader, "multiplier": repr(multiplier), "offset": repr(offset)}
            SubElement(element, "drake:mimic", attributes)
    if differential == "system":
        plugin = SubElement(model, "plugin", LOADER)
        for tag, name in (("module_name", SYSTEM), ("left", "rocker_left_joint"), ("right", "rocker_right_joint")):
            SubElement(plugin, tag).text = name
        _leaf(plugin, "inertia", differential_inertia(rover))
        _leaf(plugin, "coefficients", *rover.differential)
    return model


def _leaf(parent: Element, tag: str, *values: float) -> None:
    """Add an element with numbers that read back to the same bits."""
    SubElement(parent, tag).text = " ".join(repr(float(v) + 0.0) for v in values)
