"""Command `rockerbogie export`: a rover as URDF, SDF, MJCF, USD or TOML, or a Gazebo world."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from ..errors import RockerbogieError
from ..rover.formats import differential_system, load_rover, to_sdf, to_toml, to_urdf, to_usd
from ..rover.formats.gazebo import WORLD_FILES, write_world
from ..rover.formats.sdf_write import Coupling
from .common import Force, guard_outputs, in_folder, make_folder, middle, parse_point
from .rasters import Raster, load_terrain

Format = Literal["urdf", "sdf", "mjcf", "usd", "toml", "world"]
ENDINGS: dict[Format, tuple[str, ...]] = {
    "urdf": (".urdf",), "sdf": (".sdf",), "mjcf": (".xml",), "usd": (".usda", ".usd"), "toml": (".toml",),
}  # fmt: skip
#: Height of the rover's start in a world above its settled pose, or above contact with its joints at 0, m.
DROP = 0.02
#: Note on standard error, by format: programs that do not hold the differential of the file.
NOTES = {
    "urdf": "the differential is a mimic joint: Drake and Gazebo with bullet-featherstone hold it; MuJoCo, PyBullet and Gazebo's "
    "default engine (DART) let the rockers turn freely (docs/formats.md)",
    "sdf": "the differential is a mimic axis: Drake and Gazebo with bullet-featherstone hold it; Gazebo's default engine (DART) "
    "lets the rockers turn freely: for every engine, give --differential system (docs/formats.md)",
}
SYSTEM_NOTE = "{file} is the differential: start Gazebo with GZ_SIM_SYSTEM_PLUGIN_PATH={folder} (gz sim 8 or newer)"


def export(
    rover: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    to: Annotated[Format | None, Parameter(name=["--to", "--format"])] = None,
    differential: Coupling = "mimic",
    ros2_control: Annotated[bool, Parameter(negative="")] = False,
    terrain: Annotated[str | None, Parameter(name=["--terrain", "-t"])] = None,
    at: str | None = None,
    yaw: float = 0.0,
    raster: Raster = None,
    force: Force = False,
) -> None:
    """Export a rover to another program's format, with its differential.

    Parameters
    ----------
    rover
        A preset's name, or a rover file.
    output
        The file to write (.urdf, .sdf, .xml for MJCF, .usda or .usd, .toml); for a world, the folder.
    to
        Format, if the file's ending does not determine it.
    differential
        For SDF. mimic: a constraint that some engines support. system: a Gazebo system in the same folder, for every
        engine.
    ros2_control
        Add a ros2_control block to a URDF.
    terrain
        Terrain of a world or an MJCF: a raster file, or surface:NAME.
    at
        Position of the rover in the world, x,y in metres. Default: the middle of the map.
    yaw
        Yaw of the rover there, degrees.
    force
        Replace existing output files, even if they were edited. Inputs are never replaced.
    """
    chosen = to or next((name for name, endings in ENDINGS.items() if output.suffix.lower() in endings), None)
    if chosen is None:
        known = ", ".join(ending for endings in ENDINGS.values() for ending in endings)
        raise RockerbogieError(f"{str(output)!r} has no ending of a format: end it in {known}, or give --to")
    if differential != "mimic" and chosen not in ("sdf", "world"):
        raise RockerbogieError(f"--differential applies to an SDF, not to {chosen}")
    if ros2_control and chosen != "urdf":
        raise RockerbogieError(f"--ros2-control applies to a URDF, not to {chosen}")
    if terrain is None and chosen == "world":
        raise RockerbogieError("a world needs terrain: give --terrain a raster file or surface:NAME")
    if terrain is not None and chosen not in ("world", "mjcf"):
        raise RockerbogieError(f"--terrain applies to a world or an MJCF, not to {chosen}")
    system, source = differential_system()
    outputs = in_folder(output, *WORLD_FILES) if chosen == "world" else [output]
    if chosen == "sdf" and differential == "system":
        outputs.append(output.parent / system)
    guard_outputs(outputs, rover, terrain, force=force)
    machine = load_rover(rover)
    ground = None if terrain is None else load_terrain(terrain, None, raster)
    if chosen == "world" and ground is not None:
        from ..settling.settle import settle

        x, y = middle(ground) if at is None else parse_point(at, "--at")
        pose = settle(machine, ground, x, y, np.radians(yaw))
        if not np.isfinite(pose.z):
            raise RockerbogieError(f"the rover has no pose at ({x:g}, {y:g}) m: give another position with --at")
        straight = replace(pose, q=pose.q * (1, 1, 1, 0, 0, 0))  # a world starts with the joints at 0
        depth = min(0.0, float(np.nanmin([*straight.gap, straight.clearance])))
        start = (x, y, float(pose.z) - depth + DROP, float(pose.roll), float(pose.pitch), float(pose.yaw))
        for file in write_world(make_folder(output), machine, ground.origin, ground.spacing, ground.z, start):
            print(file)
        _note(SYSTEM_NOTE.format(file=output / system, folder=output))
        return
    if chosen == "mjcf":
        from ..simulation.mjcf import to_mjcf

        text = to_mjcf(machine, ground)
    elif chosen == "urdf":
        text = to_urdf(machine, ros2_control=ros2_control)
    elif chosen == "sdf":
        text = to_sdf(machine, differential=differential)
    else:
        text = {"usd": to_usd, "toml": to_toml}[chosen](machine)
    make_folder(output.parent)
    for file, content in zip(outputs, (text, source), strict=False):
        try:
            file.write_text(content, encoding="utf-8")
        except OSError as error:
            raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None
        print(file)
    if len(outputs) > 1:
        _note(SYSTEM_NOTE.format(file=outputs[1], folder=output.parent))
    elif chosen in NOTES:
        _note(NOTES[chosen])


def _note(text: str) -> None:
    """Print a note on standard error."""
    print(f"rockerbogie: note: {text}", file=sys.stderr)
