"""Gazebo world: the terrain as a mesh, a sun, the rover and the system of its differential."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...errors import RoverError
from ..model import Rover
from .sdf_write import NAMESPACES, VERSION, differential_system, model_element

#: Gazebo's collision engine is slow with more triangles: a finer terrain is thinned to every second, third, ... node.
MOST_TRIANGLES = 250_000
#: Names of the files that `write_world` writes.
WORLD_FILES = ("world.sdf", "ground.obj", differential_system()[0])


def write_world(
    folder: Path,
    rover: Rover,
    origin: tuple[float, float],
    spacing: tuple[float, float],
    z: Array,
    pose: tuple[float, ...],
) -> list[Path]:
    """Write `world.sdf`, `ground.obj` and the system of the differential into a folder.

    Load it there with `GZ_SIM_SYSTEM_PLUGIN_PATH=. gz sim world.sdf` (gz sim 8 or newer).

    Args:
        folder: an existing folder.
        rover: the rover.
        origin, spacing: x, y of the terrain's first node and the steps between nodes, m.
        z: (rows, cols) the nodes' heights, m; cells with a NaN corner are left out.
        pose: the rover's body x, y, z (m), roll, pitch, yaw (rad).

    Returns:
        The files written.

    Raises:
        RoverError: a terrain without a complete cell.
    """
    step = max(1, int(np.ceil(np.sqrt(2 * z.size / MOST_TRIANGLES))))
    z = z[::step, ::step]
    known = np.isfinite(z)
    cells = np.argwhere(known[:-1, :-1] & known[1:, :-1] & known[:-1, 1:] & known[1:, 1:])
    if not len(cells):
        raise RoverError("the terrain has no cell with data at its four corners: choose another terrain")
    x, y = (origin[k] + step * spacing[k] * np.arange(z.shape[1 - k], dtype=np.float64) for k in (0, 1))
    ground = folder / "ground.obj"
    ground.write_text(_obj(x, y, z, cells), encoding="ascii")
    sdf = Element("sdf", {"version": VERSION} | NAMESPACES)
    world = SubElement(sdf, "world", name=f"{rover.name}_world")
    sun = SubElement(world, "light", name="sun", type="directional")
    for tag, text in (
        ("pose", "0 0 100 0 0 0"),
        ("diffuse", "0.9 0.85 0.8 1"),
        ("direction", "-0.4 0.2 -0.9"),
        ("cast_shadows", "true"),
    ):
        SubElement(sun, tag).text = text
    scenery = SubElement(world, "model", name="ground")
    SubElement(scenery, "static").text = "true"
    link = SubElement(scenery, "link", name="ground_link")
    for use in ("collision", "visual"):
        element = SubElement(link, use, name=f"ground_{use}")
        mesh = SubElement(SubElement(element, "geometry"), "mesh")
        SubElement(mesh, "uri").text = ground.name
    machine = model_element(rover, "system")
    placed = Element("pose")
    placed.text = " ".join(repr(float(v)) for v in pose)
    machine.insert(0, placed)
    world.append(machine)
    indent(sdf)
    path = folder / "world.sdf"
    path.write_text('<?xml version="1.0"?>\n' + tostring(sdf, encoding="unicode") + "\n", encoding="utf-8")
    name, source = differential_system()
    (folder / name).write_text(source, encoding="utf-8")
    return [path, ground, folder / name]


def _obj(x: Array, y: Array, z: Array, cells: NDArray[np.int64]) -> str:
    """Return the terrain as Wavefront OBJ text, two triangles for each cell, facing up."""
    cols = z.shape[1]
    heights = np.where(np.isfinite(z), z, 0.0)
    lines = [f"v {x[c]:.6f} {y[r]:.6f} {heights[r, c]:.6f}" for r in range(z.shape[0]) for c in range(cols)]
    for r, c in cells:
        a = r * cols + c + 1
        lines += [f"f {a} {a + 1} {a + cols + 1}", f"f {a} {a + cols + 1} {a + cols}"]
    return "\n".join(lines) + "\n"
