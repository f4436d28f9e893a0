"""Drop a rover on rocks in PhysX, Isaac Sim's engine; print the differential's error.

PhysX runs on the CPU. Its packages need other versions than this project's tests, so install them in an environment of their own:

    python -m venv /tmp/physx && /tmp/physx/bin/pip install ovphysx physx-usd-schemas newton-usd-schemas usd-core -e .
    PYTHONPATH=tests /tmp/physx/bin/python tools/drop_physx.py osr

The result is in docs/formats.md.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import rockerbogie as rb
from support.rocks import Rock, rocks, start_height

STEP, SECONDS = 1 / 240, 3.0  # s
FLOOR = Rock((20.0, 20.0, 1.0), (0.0, 0.0, -0.5), (0.0, 0.0, 0.0))


def world(rover: rb.Rover, file: Path) -> str:
    """Return a USD scene with the rover's file above rocks.

    Args:
        rover: the rover.
        file: its USD file.

    Returns:
        Text of a .usda file.
    """
    boxes = "".join(
        f'def Cube "box{k}" (\n prepend apiSchemas = ["PhysicsCollisionAPI"]\n)\n{{\n double size = 1\n'
        f" double3 xformOp:translate = {box.at}\n double3 xformOp:rotateXYZ = {tuple(np.degrees(box.rpy).tolist())}\n"
        f" double3 xformOp:scale = {box.size}\n"
        ' uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]\n}\n'
        for k, box in enumerate([FLOOR, *rocks(rover)])
    )
    return (
        '#usda 1.0\n(\n defaultPrim = "World"\n metersPerUnit = 1\n kilogramsPerUnit = 1\n upAxis = "Z"\n)\n'
        'def Xform "World"\n{\n'
        'def PhysicsScene "scene"\n{\n vector3f physics:gravityDirection = (0, 0, -1)\n'
        " float physics:gravityMagnitude = 9.80665\n}\n"
        f'{boxes}def Xform "rover" (\n prepend references = @{file}@\n)\n{{\n'
        f" double3 xformOp:translate = (0, 0, {start_height(rover)})\n"
        ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n}\n'
    )


def drop(rover: rb.Rover, folder: Path) -> np.ndarray:
    """Return the angles of the rockers while the rover falls on the rocks.

    Args:
        rover: the rover.
        folder: for the USD files.

    Returns:
        (n, 2) rad, left and right.
    """
    import ovphysx
    import ovstage
    from ovphysx.samples.python_samples.schema_support import physx_schema_paths
    from ovphysx.types import ObjectScope, SimObjectType

    file, scene = folder / f"{rover.name}.usda", folder / f"{rover.name}_world.usda"
    file.write_text(rb.to_usd(rover))
    scene.write_text(world(rover, file))
    physx = ovphysx.PhysX()
    ovstage.population.register_usd_schemas([*map(str, physx_schema_paths()), str(ovphysx.newton_schema_root())])
    stage = ovstage.Stage("drop")
    ovstage.population.open_usd(stage, str(scene), ordinal=1, domains=ovstage.PopulationDomain.ALL)
    stage.advance_write_floor(ordinal=1).wait()
    physx.wait_task(physx.attach_ovstage(stage, read_ordinal=1))

    def positions() -> dict[str, float]:
        with (
            ovstage.PathDictionary(stage) as paths,
            physx.read_sync(SimObjectType.ARTICULATION_JOINT, ["jointPosition"], scope=ObjectScope.ALL) as result,
        ):
            return {
                paths.path_to_string(path): float(np.radians(tensor.numpy()[0]))
                for group in result.groups
                for path, tensor in zip(paths.get_paths(group.prim_list), group.tensors, strict=True)
            }

    angles = []
    for _ in range(round(SECONDS / STEP)):
        physx.step_sync(STEP)
        found = positions()
        angles.append([found[f"/World/rover/joints/rocker_{side}_joint"] for side in ("left", "right")])
    physx.wait_task(physx.detach_ovstage())
    stage.destroy()
    physx.destroy()
    return np.array(angles)


def main() -> None:
    """Drop the rover of the command line, and print its numbers."""
    (name,) = sys.argv[1:] or ["osr"]
    rover = rb.load_rover(name)
    with tempfile.TemporaryDirectory() as folder:
        angles = drop(rover, Path(folder))
    error = np.abs(angles[:, 1] - rover.differential[1] * angles[:, 0])
    print(f"{name}: rockers turn by {np.abs(angles).max():.2g} rad, error {error.max():.1e}, after 0.5 s {error[120:].max():.1e}")


if __name__ == "__main__":
    main()
