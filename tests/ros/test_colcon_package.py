"""Package for colcon: build, launch file, and the installed node with its files."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from rockerbogie.cli import main
from ros.ros_bench import needs_ros

COLCON = Path(sys.executable).with_name("colcon")
pytestmark = [
    needs_ros,
    pytest.mark.skipif(not COLCON.exists(), reason="colcon is not installed (colcon-core and colcon-ros, extra dev)"),
]
SOURCES = Path(__file__).resolve().parents[2] / "src"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Return the prefix into which colcon installs the package."""
    root = tmp_path_factory.mktemp("workspace")
    assert main(["ros", "--write-package", str(root / "src"), "--rover", "osr", "--set", "state_rate=20"]) == 0
    done = subprocess.run([COLCON, "build"], check=False, cwd=root, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return root / "install" / "rockerbogie_ros"


def recorded(name, made):
    """Return a stand-in for a class of launch, whose instances are listed in `made`."""

    def make(*args, **options):
        item = SimpleNamespace(kind=name, args=args, **options)
        made.append(item)
        return item

    return make


def test_the_launch_file_makes_the_installed_node(installed, monkeypatch):
    """Run the launch file with stand-ins for launch and launch_ros, which have no wheels."""
    made: list[SimpleNamespace] = []
    for module, names in {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["LifecycleNode"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
    }.items():
        stand_in = ModuleType(module)
        for name in names:
            setattr(stand_in, name, recorded(name, made))
        monkeypatch.setitem(sys.modules, module, stand_in)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(installed))
    spec = importlib.util.spec_from_file_location("rover_launch", installed / "share/rockerbogie_ros/launch/rover.launch.py")
    launch = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(launch)
    description = launch.generate_launch_description()
    node = next(item for item in made if item.kind == "LifecycleNode")
    arguments = {item.args[0]: item.default_value for item in made if item.kind == "DeclareLaunchArgument"}
    used = {item.args[0] for item in made if item.kind == "LaunchConfiguration"}
    assert used == arguments.keys() == {"params", "namespace", "use_sim_time", "rover"}
    assert all(Path(arguments[name]).is_file() for name in ("params", "rover"))
    assert (installed / "lib" / node.package / node.executable).is_file()
    assert node in description.args[0]


def test_the_installed_node_runs_with_its_parameters(installed):
    """Start the executable as the launch file does: its files give rover and state rate."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray

    share = installed / "share/rockerbogie_ros/config"
    site = next(installed.glob("lib/python*/site-packages"))
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(site), str(SOURCES)]),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(100 + os.getpid() % 100),
    }
    os.environ |= {name: environment[name] for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID")}
    command = [
        installed / "lib/rockerbogie_ros/rover_node", "--ros-args", "-r", "__ns:=/r4",
        "--params-file", share / "rover.yaml", "-p", f"rover:={share / 'rover.toml'}",
    ]  # fmt: skip
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node("launch_watcher", context=context)
        executor = rclpy.executors.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        found: list[DiagnosticArray] = []
        node.create_subscription(DiagnosticArray, "/r4/rover/state", found.append, 10)
        end = time.monotonic() + 40
        while len(found) < 5 and time.monotonic() < end and process.poll() is None:
            executor.spin_once(timeout_sec=0.1)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=15)
    finally:
        process.kill()
        context.try_shutdown()
    assert len(found) >= 5, errors
    assert found[0].status[0].hardware_id == "osr"
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in found]
    assert stamps[-1] - stamps[0] < 1.0, "20 Hz, as the file of parameters says"
    assert process.returncode == 0, errors
