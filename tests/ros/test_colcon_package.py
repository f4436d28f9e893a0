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
from ros.ros_bench import PATIENCE, needs_ros, use_own_domain

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
    done = subprocess.run([COLCON, "build"], check=False, cwd=root, capture_output=True, text=True, timeout=PATIENCE)
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
    from rclpy.parameter_client import AsyncParameterClient

    share = installed / "share/rockerbogie_ros/config"
    site = next(installed.glob("lib/python*/site-packages"))
    use_own_domain()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(site), str(SOURCES)])}
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
        client, values = AsyncParameterClient(node, "/r4/rockerbogie"), None
        end = time.monotonic() + PATIENCE
        while not (found and values and values.done()) and time.monotonic() < end and process.poll() is None:
            executor.spin_once(timeout_sec=0.1)
            if values is None and client.services_are_ready():
                values = client.get_parameters(["state_rate", "rover"])
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        context.try_shutdown()
    assert found, errors
    assert found[0].status[0].hardware_id == "osr"
    rate, rover = values.result().values
    assert rate.double_value == 20.0, "as the file of parameters says"
    assert rover.string_value == str(share / "rover.toml")
    assert process.returncode == 0, errors
