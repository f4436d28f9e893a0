"""How a six-wheeled rocker-bogie rover sits, tilts, rolls and slips on a piece of ground.

Everything public is here: `import rockerbogie as rb`. A name loads its module when it is first used, so that the
import itself costs next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from . import surfaces as surfaces
    from .actuation import wheel_commands as wheel_commands
    from .compare import compare as compare
    from .compare import settle_along as settle_along
    from .differential import DifferentialBar as DifferentialBar
    from .drive import drive as drive
    from .errors import PathError as PathError
    from .errors import RockerbogieError as RockerbogieError
    from .errors import RoverError as RoverError
    from .errors import TerrainError as TerrainError
    from .formats import Import as Import
    from .formats import import_rover as import_rover
    from .formats import load_rover as load_rover
    from .formats import to_sdf as to_sdf
    from .formats import to_toml as to_toml
    from .formats import to_urdf as to_urdf
    from .frames import body_transform as body_transform
    from .frames import contact_frames as contact_frames
    from .frames import dh_table as dh_table
    from .frames import wheel_frames as wheel_frames
    from .jacobian import JACOBIAN_COLUMNS as JACOBIAN_COLUMNS
    from .jacobian import SimpleStance as SimpleStance
    from .jacobian import system_jacobian as system_jacobian
    from .jacobian import wheel_jacobians as wheel_jacobians
    from .logs import read_log as read_log
    from .maps.files import read_map as read_map
    from .maps.files import write_map as write_map
    from .maps.limits import Limits as Limits
    from .maps.plan import plan as plan
    from .maps.route import Plan as Plan
    from .maps.traversability import traversability as traversability
    from .mjcf import to_mjcf as to_mjcf
    from .navigation import Noise as Noise
    from .navigation import body_twist as body_twist
    from .odometry import SlopeSlip as SlopeSlip
    from .odometry import flat_odometry as flat_odometry
    from .odometry import odometry as odometry
    from .path import Path as Path
    from .places import LogMap as LogMap
    from .places import read_places as read_places
    from .pose import Pose as Pose
    from .rosbag import write_mcap as write_mcap
    from .rover import Link as Link
    from .rover import Rover as Rover
    from .settle import settle as settle
    from .simulate import simulate as simulate
    from .slip import wheel_slip as wheel_slip
    from .status import Status as Status
    from .terrain import Terrain as Terrain
    from .validate import validate as validate
    from .verification import Verification as Verification
    from .verification import verify as verify

#: Public name -> the module that holds it; none where the name is a module itself.
_EXPORTS = {
    "RockerbogieError": "errors",
    "RoverError": "errors",
    "TerrainError": "errors",
    "PathError": "errors",
    "Status": "status",
    "Rover": "rover",
    "Link": "rover",
    "load_rover": "formats",
    "import_rover": "formats",
    "Import": "formats",
    "DifferentialBar": "differential",
    "to_toml": "formats",
    "to_urdf": "formats",
    "to_sdf": "formats",
    "wheel_frames": "frames",
    "contact_frames": "frames",
    "body_transform": "frames",
    "dh_table": "frames",
    "Terrain": "terrain",
    "surfaces": "",
    "Path": "path",
    "settle": "settle",
    "Pose": "pose",
    "verify": "verification",
    "Verification": "verification",
    "wheel_jacobians": "jacobian",
    "JACOBIAN_COLUMNS": "jacobian",
    "system_jacobian": "jacobian",
    "SimpleStance": "jacobian",
    "body_twist": "navigation",
    "Noise": "navigation",
    "wheel_commands": "actuation",
    "wheel_slip": "slip",
    "drive": "drive",
    "odometry": "odometry",
    "flat_odometry": "odometry",
    "SlopeSlip": "odometry",
    "read_log": "logs",
    "write_mcap": "rosbag",
    "to_mjcf": "mjcf",
    "simulate": "simulate",
    "settle_along": "compare",
    "compare": "compare",
    "validate": "validate",
    "read_places": "places",
    "LogMap": "places",
    "traversability": "maps.traversability",
    "Limits": "maps.limits",
    "write_map": "maps.files",
    "read_map": "maps.files",
    "plan": "maps.plan",
    "Plan": "maps.route",
}

__all__ = ["__version__", *_EXPORTS]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    holder = _EXPORTS[name]
    module = import_module(f".{holder or name}", __name__)
    value = globals()[name] = getattr(module, name) if holder else module
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_EXPORTS})


class _Package(ModuleType):
    """Keeps `rb.settle` the function: importing the submodule `settle` would otherwise bind its module there."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (isinstance(value, ModuleType) and name in _EXPORTS):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
