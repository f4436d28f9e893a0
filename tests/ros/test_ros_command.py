"""Command `rockerbogie ros` without ROS: help, one sentence, package for colcon, parameters."""

from __future__ import annotations

import subprocess
import sys
from xml.etree import ElementTree

import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.ros.parameters import PARAMETERS

#: Run the command in a Python in which no package of ROS can be imported.
WITHOUT_ROS = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0].endswith(("rclpy", "_msgs")):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing())
import rockerbogie.ros.intake, rockerbogie.ros.joints, rockerbogie.ros.package
from rockerbogie.cli import main
sys.exit(main(sys.argv[1:]))
"""


def without_ros(*args):
    return subprocess.run([sys.executable, "-c", WITHOUT_ROS, *args], capture_output=True, text=True, check=False)


def test_help_needs_no_ros():
    done = without_ros("ros", "--help")
    assert done.returncode == 0
    assert "cmd_vel" in done.stdout


def test_without_ros_the_node_is_refused_by_one_sentence():
    done = without_ros("ros", "--rover", "osr")
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "pip install 'rockerbogie[ros2]'" in done.stderr


def test_a_package_for_colcon_is_written(tmp_path, capsys):
    """Write the package: valid XML and Python, all parameters, the rover; edited files stay."""
    assert main(["ros", "--write-package", str(tmp_path), "--rover", "osr", "--set", "cmd_vel_timeout=1.5"]) == 0
    root = tmp_path / "rockerbogie_ros"
    files = {str(f.relative_to(root)) for f in root.rglob("*") if f.is_file()}
    assert files == {
        "README.md", "package.xml", "setup.py", "setup.cfg", "resource/rockerbogie_ros", "rockerbogie_ros/__init__.py",
        "rockerbogie_ros/rover_node.py", "launch/rover.launch.py", "config/rover.toml", "config/rover.yaml",
    }  # fmt: skip
    assert ElementTree.parse(root / "package.xml").findtext("export/build_type") == "ament_python"
    for file in root.rglob("*.py"):
        compile(file.read_text(encoding="utf-8"), str(file), "exec")
    text = (root / "config" / "rover.yaml").read_text(encoding="utf-8")
    assert "    cmd_vel_timeout: 1.5  #" in text
    assert all(f" {name}:" in text for name in PARAMETERS)
    assert rb.load_rover(root / "config" / "rover.toml").wheel_names == rb.load_rover("osr").wheel_names
    capsys.readouterr()
    assert main(["ros", "--write-package", str(tmp_path), "--rover", "osr"]) == 2
    assert "exists and may have been edited" in capsys.readouterr().err


@pytest.mark.parametrize(
    "args, message",
    [
        (["--set", "nonsense=1"], "no parameter named"),
        (["--set", "command_rate"], "is not a pair"),
        (["--set", "command_rate=fast"], "give a number"),
        (["--set", "use_imu=perhaps"], "give true or false"),
        (["--name", "corner"], "THEIRS=OURS"),
        (["--write-package", "somewhere"], "needs --rover"),
        (["--params", "missing.yaml"], "is not a file"),
        (["--rover", "nonsense"], "nonsense"),
    ],
)
def test_wrong_options_are_refused(args, message, capsys):
    assert main(["ros", *args]) == 2
    assert message in capsys.readouterr().err


def test_all_parameters_are_listed_and_documented(capsys):
    from pathlib import Path

    assert main(["ros", "--list-parameters"]) == 0
    listed = capsys.readouterr().out
    page = (Path(__file__).resolve().parents[2] / "docs" / "ros.md").read_text(encoding="utf-8")
    for name, parameter in PARAMETERS.items():
        assert f"{name}:" in listed
        assert f"| `{name}` | {parameter.text} |" in page
