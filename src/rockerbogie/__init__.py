"""Kinematics of six-wheeled rocker-bogie rovers on terrain.

All public names are here: `import rockerbogie as rb`. Each name loads its module at first use, so that the import itself is fast.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from .figures.scene.registration import register_with_xarray
from .files.version import __version__

if TYPE_CHECKING:
    from .bench.compilation import Compiled as Compiled
    from .bench.compilation import compile_kernels as compile_kernels
    from .errors import PathError as PathError
    from .errors import RockerbogieError as RockerbogieError
    from .errors import RoverError as RoverError
    from .errors import TerrainError as TerrainError
    from .errors import TerrainWarning as TerrainWarning
    from .figures import plot as plot
    from .figures.scene.show import View as View
    from .figures.scene.show import show as show
    from .figures.scene.show import to_html as to_html
    from .gravity import GRAVITY as GRAVITY
    from .logs.attitude_log import LogMap as LogMap
    from .logs.attitude_log import read_places as read_places
    from .logs.benchmark import MarsBenchmark as MarsBenchmark
    from .logs.benchmark import benchmark_mars as benchmark_mars
    from .logs.benchmark import write_benchmark_template as write_benchmark_template
    from .logs.channels import LogWarning as LogWarning
    from .logs.estimate import Estimate as Estimate
    from .logs.forecast import forecast_slip as forecast_slip
    from .logs.forecast_score import score_forecast as score_forecast
    from .logs.joint_log import read_log as read_log
    from .logs.mcap import write_mcap as write_mcap
    from .logs.odometry import SlopeSlip as SlopeSlip
    from .logs.odometry import flat_odometry as flat_odometry
    from .logs.odometry import odometry as odometry
    from .logs.odometry_filter import OdometryFilter as OdometryFilter
    from .logs.slip_fit import SoilFit as SoilFit
    from .logs.slip_fit import fit_soil as fit_soil
    from .logs.slip_log import read_slip_log as read_slip_log
    from .logs.slip_table import slip_table as slip_table
    from .logs.slip_table import write_slip_table as write_slip_table
    from .logs.validate import validate as validate
    from .maps.files import read_map as read_map
    from .maps.files import write_map as write_map
    from .maps.limits import Limits as Limits
    from .maps.plan import plan as plan
    from .maps.plan import reachability as reachability
    from .maps.slip import SlipCost as SlipCost
    from .maps.slip import slip_layers as slip_layers
    from .maps.traversability import traversability as traversability
    from .motion.body_twist import Motion as Motion
    from .motion.body_twist import Noise as Noise
    from .motion.body_twist import RatePrior as RatePrior
    from .motion.body_twist import SensorNoise as SensorNoise
    from .motion.body_twist import body_twist as body_twist
    from .motion.drive import ackermann as ackermann
    from .motion.drive import drive as drive
    from .motion.drive import to_csv as to_csv
    from .motion.jacobian import JACOBIAN_COLUMNS as JACOBIAN_COLUMNS
    from .motion.jacobian import ContactState as ContactState
    from .motion.jacobian import SimpleStance as SimpleStance
    from .motion.jacobian import system_jacobian as system_jacobian
    from .motion.jacobian import wheel_jacobians as wheel_jacobians
    from .motion.path import Path as Path
    from .motion.path import PathSample as PathSample
    from .motion.path_files import Plan as Plan
    from .motion.path_files import Route as Route
    from .motion.path_files import read_route as read_route
    from .motion.prediction.outcome import DriveEnd as DriveEnd
    from .motion.prediction.predict import predict as predict
    from .motion.slip import Slip as Slip
    from .motion.slip import wheel_slip as wheel_slip
    from .motion.soil_slip import SoilSlip as SoilSlip
    from .motion.wheel_commands import Commands as Commands
    from .motion.wheel_commands import arc as arc
    from .motion.wheel_commands import commands_along as commands_along
    from .motion.wheel_commands import crab as crab
    from .motion.wheel_commands import straight as straight
    from .motion.wheel_commands import turn_in_place as turn_in_place
    from .motion.wheel_commands import wheel_commands as wheel_commands
    from .motion.wheel_controller import WheelCommand as WheelCommand
    from .motion.wheel_controller import WheelController as WheelController
    from .ros.costmap import CostMap as CostMap
    from .ros.costmap import CostMapChange as CostMapChange
    from .rover.differential import DifferentialBar as DifferentialBar
    from .rover.formats import Import as Import
    from .rover.formats import ImportResult as ImportResult
    from .rover.formats import differential_system as differential_system
    from .rover.formats import import_rover as import_rover
    from .rover.formats import load_rover as load_rover
    from .rover.formats import to_sdf as to_sdf
    from .rover.formats import to_toml as to_toml
    from .rover.formats import to_urdf as to_urdf
    from .rover.formats import to_usd as to_usd
    from .rover.frames import DHRow as DHRow
    from .rover.frames import contact_frames as contact_frames
    from .rover.frames import dh_table as dh_table
    from .rover.frames import wheel_frames as wheel_frames
    from .rover.model import Link as Link
    from .rover.model import Rover as Rover
    from .rover.rotations import body_transform as body_transform
    from .settling.pose import Contacts as Contacts
    from .settling.pose import Pose as Pose
    from .settling.settle import settle as settle
    from .settling.status import Status as Status
    from .settling.verification import Verification as Verification
    from .settling.verification import verify as verify
    from .simulation.compare import Channel as Channel
    from .simulation.compare import Comparison as Comparison
    from .simulation.compare import compare as compare
    from .simulation.compare import settle_along as settle_along
    from .simulation.mjcf import to_mjcf as to_mjcf
    from .simulation.simulate import simulate as simulate
    from .statics import obstacles as obstacles
    from .statics.climb import Climb as Climb
    from .statics.climb import climb as climb
    from .statics.climb_limits import ClimbLimits as ClimbLimits
    from .statics.climb_limits import limits_of as limits_of
    from .statics.loads import LoadStatus as LoadStatus
    from .statics.loads import WheelLoads as WheelLoads
    from .statics.loads import wheel_loads as wheel_loads
    from .statics.obstacles import Profile as Profile
    from .statics.stability import Stability as Stability
    from .statics.stability import stability as stability
    from .terrain import surfaces as surfaces
    from .terrain.heightfield import Terrain as Terrain
    from .terrain.soil.fit import TrialResiduals as TrialResiduals
    from .terrain.soil.fit import WheelFit as WheelFit
    from .terrain.soil.fit import WheelTrials as WheelTrials
    from .terrain.soil.fit import fit_slip_curve as fit_slip_curve
    from .terrain.soil.fit import fit_wheel_trials as fit_wheel_trials
    from .terrain.soil.forces import ForceStatus as ForceStatus
    from .terrain.soil.forces import WheelForces as WheelForces
    from .terrain.soil.forces import wheel_soil_forces as wheel_soil_forces
    from .terrain.soil.laws import Coulomb as Coulomb
    from .terrain.soil.laws import Grousers as Grousers
    from .terrain.soil.laws import SlipCurve as SlipCurve
    from .terrain.soil.laws import Soil as Soil
    from .terrain.soil.load import load_soil as load_soil
    from .terrain.soil.load import soils as soils

#: Public name -> module.
_EXPORTS = {
    "RockerbogieError": "errors",
    "RoverError": "errors",
    "TerrainError": "errors",
    "TerrainWarning": "errors",
    "PathError": "errors",
    "Status": "settling.status",
    "Rover": "rover.model",
    "Link": "rover.model",
    "load_rover": "rover.formats",
    "import_rover": "rover.formats",
    "ImportResult": "rover.formats",
    "Import": "rover.formats",
    "DifferentialBar": "rover.differential",
    "to_toml": "rover.formats",
    "to_urdf": "rover.formats",
    "to_sdf": "rover.formats",
    "to_usd": "rover.formats",
    "differential_system": "rover.formats",
    "wheel_frames": "rover.frames",
    "contact_frames": "rover.frames",
    "body_transform": "rover.rotations",
    "dh_table": "rover.frames",
    "DHRow": "rover.frames",
    "Terrain": "terrain.heightfield",
    "surfaces": "terrain",
    "plot": "figures",
    "Path": "motion.path",
    "PathSample": "motion.path",
    "settle": "settling.settle",
    "Pose": "settling.pose",
    "Contacts": "settling.pose",
    "verify": "settling.verification",
    "Verification": "settling.verification",
    "GRAVITY": "gravity",
    "soils": "terrain.soil.load",
    "load_soil": "terrain.soil.load",
    "Soil": "terrain.soil.laws",
    "wheel_soil_forces": "terrain.soil.forces",
    "WheelForces": "terrain.soil.forces",
    "ForceStatus": "terrain.soil.forces",
    "Grousers": "terrain.soil.laws",
    "Coulomb": "terrain.soil.laws",
    "SlipCurve": "terrain.soil.laws",
    "fit_wheel_trials": "terrain.soil.fit",
    "fit_slip_curve": "terrain.soil.fit",
    "WheelTrials": "terrain.soil.fit",
    "WheelFit": "terrain.soil.fit",
    "TrialResiduals": "terrain.soil.fit",
    "CostMap": "ros.costmap",
    "CostMapChange": "ros.costmap",
    "LoadStatus": "statics.loads",
    "Stability": "statics.stability",
    "stability": "statics.stability",
    "WheelLoads": "statics.loads",
    "wheel_loads": "statics.loads",
    "obstacles": "statics",
    "Profile": "statics.obstacles",
    "climb": "statics.climb",
    "Climb": "statics.climb",
    "limits_of": "statics.climb_limits",
    "ClimbLimits": "statics.climb_limits",
    "wheel_jacobians": "motion.jacobian",
    "JACOBIAN_COLUMNS": "motion.jacobian",
    "system_jacobian": "motion.jacobian",
    "SimpleStance": "motion.jacobian",
    "ContactState": "motion.jacobian",
    "body_twist": "motion.body_twist",
    "Motion": "motion.body_twist",
    "RatePrior": "motion.body_twist",
    "SensorNoise": "motion.body_twist",
    "Noise": "motion.body_twist",
    "wheel_commands": "motion.wheel_commands",
    "Commands": "motion.wheel_commands",
    "straight": "motion.wheel_commands",
    "arc": "motion.wheel_commands",
    "crab": "motion.wheel_commands",
    "turn_in_place": "motion.wheel_commands",
    "commands_along": "motion.wheel_commands",
    "WheelController": "motion.wheel_controller",
    "WheelCommand": "motion.wheel_controller",
    "wheel_slip": "motion.slip",
    "Slip": "motion.slip",
    "drive": "motion.drive",
    "ackermann": "motion.drive",
    "to_csv": "motion.drive",
    "predict": "motion.prediction.predict",
    "DriveEnd": "motion.prediction.outcome",
    "odometry": "logs.odometry",
    "flat_odometry": "logs.odometry",
    "SlopeSlip": "logs.odometry",
    "OdometryFilter": "logs.odometry_filter",
    "Estimate": "logs.estimate",
    "LogWarning": "logs.channels",
    "read_log": "logs.joint_log",
    "write_mcap": "logs.mcap",
    "to_mjcf": "simulation.mjcf",
    "simulate": "simulation.simulate",
    "settle_along": "simulation.compare",
    "compare": "simulation.compare",
    "Comparison": "simulation.compare",
    "Channel": "simulation.compare",
    "validate": "logs.validate",
    "read_slip_log": "logs.slip_log",
    "fit_soil": "logs.slip_fit",
    "SoilFit": "logs.slip_fit",
    "SoilSlip": "motion.soil_slip",
    "SlipCost": "maps.slip",
    "slip_layers": "maps.slip",
    "slip_table": "logs.slip_table",
    "write_slip_table": "logs.slip_table",
    "forecast_slip": "logs.forecast",
    "score_forecast": "logs.forecast_score",
    "benchmark_mars": "logs.benchmark",
    "MarsBenchmark": "logs.benchmark",
    "write_benchmark_template": "logs.benchmark",
    "read_places": "logs.attitude_log",
    "LogMap": "logs.attitude_log",
    "traversability": "maps.traversability",
    "Limits": "maps.limits",
    "write_map": "maps.files",
    "read_map": "maps.files",
    "plan": "maps.plan",
    "reachability": "maps.plan",
    "Route": "motion.path_files",
    "Plan": "motion.path_files",
    "read_route": "motion.path_files",
    "show": "figures.scene.show",
    "to_html": "figures.scene.show",
    "View": "figures.scene.show",
    "compile_kernels": "bench.compilation",
    "Compiled": "bench.compilation",
}

#: Former name of a documented module -> its name.
_MOVED = {"paper": "bench.paper", "rotations": "rover.rotations", "scene": "figures.scene", "soil": "terrain.soil"}


class _MovedModules:
    """Finder and loader that give a module under its former name, with a DeprecationWarning."""

    def find_spec(self, name: str, path: object = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return a specification for a module that has moved; None for others."""
        package, _, module = name.partition(".")
        moved = package == __name__ and module.partition(".")[0] in _MOVED
        return ModuleSpec(name, self) if moved else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """Return None: the import system makes an empty module, which `exec_module` replaces."""

    def exec_module(self, module: ModuleType) -> None:
        """Put the module of the present name in place of the empty one, and warn."""
        former, dot, rest = module.__name__.removeprefix(f"{__name__}.").partition(".")
        name = f"{__name__}.{_MOVED[former]}{dot}{rest}"
        warnings.warn(f"{module.__name__} has moved to {name}", DeprecationWarning, stacklevel=2)
        sys.modules[module.__name__] = import_module(name)


sys.meta_path.insert(0, _MovedModules())
register_with_xarray()

__all__ = ["__version__", *_EXPORTS]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f".{_EXPORTS[name]}", __name__), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_EXPORTS})
