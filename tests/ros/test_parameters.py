"""Wrong parameters of the node: each gives a sentence, and no file of a user is replaced."""

from __future__ import annotations

import json

import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.ros.package import parameter_file
from rockerbogie.ros.parameters import PARAMETERS, check_value, refusal
from rockerbogie.ros.track_file import load_track, save_track
from ros.ros_bench import needs_ros, use_own_domain

NAN, INF = float("nan"), float("inf")
WRONG = [
    ("command_rate", 0.0, "0.001 to 10000"),
    ("command_rate", -5.0, "parameter command_rate is -5"),
    ("command_rate", NAN, "parameter command_rate is nan"),
    ("command_rate", INF, "parameter command_rate is inf"),
    ("state_rate", 0.0, "parameter state_rate is 0"),
    ("state_rate", -1.0, "parameter state_rate is -1"),
    ("start_position", [1.0, 2.0], "three finite numbers"),
    ("start_position", [1.0, 2.0, NAN], "three finite numbers"),
    ("imu_mounting", [0.1], "three finite numbers"),
    ("imu_mounting", [0.1, NAN, 0.0], "three finite numbers"),
    ("most_speed", -1.0, "parameter most_speed is -1"),
    ("most_speed", NAN, "parameter most_speed is nan"),
    ("cmd_vel_timeout", -1.0, "parameter cmd_vel_timeout is -1"),
    ("sensor_timeout", NAN, "parameter sensor_timeout is nan"),
    ("tip_margin_warning", NAN, "give a number, not NaN"),
    ("wheel_rate_limit", -1.0, "parameter wheel_rate_limit is -1"),
    ("smoothing_window", 0, "1 to 10000"),
    ("cost_map_headings", 0, "parameter cost_map_headings is 0"),
    ("cost_map_resolution", -0.1, "parameter cost_map_resolution is -0.1"),
    ("odom_frame", "", "parameter odom_frame is empty"),
]


def test_all_defaults_are_accepted():
    assert refusal({name: parameter.default for name, parameter in PARAMETERS.items()}, configured=False) == ""


@pytest.mark.parametrize(("name", "value", "message"), WRONG)
def test_values_out_of_range_are_refused(name, value, message):
    with pytest.raises(rb.RockerbogieError, match=message):
        check_value(name, value)
    assert message in refusal({name: value}, configured=False)


def test_parameters_that_need_a_new_configuration_are_refused_while_configured():
    assert "clean it up first" in refusal({"rover": "osr", "cmd_vel_timeout": 1.0}, configured=True)
    assert refusal({"cmd_vel_timeout": 1.0, "use_sim_time": True}, configured=True) == ""


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--set", "command_rate=-5"], "parameter command_rate is -5"),
        (["--set", "cmd_vel_timeout=nan"], "parameter cmd_vel_timeout is nan"),
        (["--set", "start_position=1,2"], "three finite numbers"),
        (["--set", "smoothing_window=1.5"], "give a whole number"),
        (["--name", "a=wheel_LF_joint", "--name", "a=wheel_RF_joint"], "'a' is given twice"),
        (["--write-package", "somewhere", "--rover", "osr", "--set", "state_rate=0"], "parameter state_rate is 0"),
    ],
)
def test_wrong_options_are_refused(args, message, capsys):
    assert main(["ros", *args]) == 2
    assert message in capsys.readouterr().err


def test_texts_and_infinity_are_written_as_yaml():
    yaml = pytest.importorskip("yaml")
    values = {"robot_description": '<robot name="a\\b">\n\t</robot>', "cmd_vel_timeout": INF, "odom_frame": "Fähre"}
    read = yaml.safe_load(parameter_file(values))["/**"]["ros__parameters"]
    assert {name: read[name] for name in values} == values


@pytest.mark.parametrize("content", [b'{"a": 1}', b"[1, 2]", b"\xff\xfe\x00", b""])
def test_a_file_of_another_program_is_no_state_file(content, tmp_path):
    """Refuse the file when the node is configured, and keep it when the track is saved."""
    file = tmp_path / "track.json"
    file.write_bytes(content)
    rover = rb.load_rover("osr")
    remedy = "was not written by rockerbogie: set state_file to another name, or move that file away$"
    with pytest.raises(rb.RockerbogieError, match=r"state_file .*track\.json.* cannot be used: .*" + remedy):
        load_track(rover, str(file))
    with pytest.raises(rb.RockerbogieError, match="the track was not saved: .*" + remedy):
        save_track(rb.OdometryFilter(rover), str(file))
    assert file.read_bytes() == content


def test_a_state_file_without_a_state_is_refused(tmp_path):
    file = tmp_path / "track.json"
    file.write_text('{"source": "rockerbogie 0.1.0"}', encoding="utf-8")
    with pytest.raises(rb.RockerbogieError, match=r"cannot be used: it holds no 'filter'$"):
        load_track(rb.load_rover("osr"), str(file))


def test_a_state_file_is_checked_before_the_drive(tmp_path):
    rover = rb.load_rover("osr")
    for wrong in (str(tmp_path), "a\0b"):
        with pytest.raises(rb.RockerbogieError, match="cannot be used"):
            load_track(rover, wrong)
    file, beside = tmp_path / "new" / "track.json", tmp_path / "new" / "track.json.part"
    assert load_track(rover, str(file)) is None
    beside.parent.mkdir()
    beside.write_text("of a user", encoding="utf-8")
    save_track(rb.OdometryFilter(rover, start=(1.0, 2.0, 3.0)), str(file))
    assert json.loads(file.read_text(encoding="utf-8"))["filter"]["settings"]["start"] == [1.0, 2.0, 3.0]
    assert beside.read_text(encoding="utf-8") == "of a user"
    assert sorted(file.parent.iterdir()) == [file, beside]
    assert load_track(rover, str(file)) is not None


@needs_ros
@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"command_rate": -5.0}, "parameter command_rate is -5"),
        ({"start_position": [1.0, 2.0]}, "three finite numbers"),
        ({"steering_limit": -1.0}, "must be above 0"),
        ({"joint_names": ["a=wheel_XX_joint"]}, "wheel_XX_joint"),
        ({"rover": "nonsense"}, "nonsense"),
        ({"rover": "", "robot_description": "<robot name='a'/>"}, "robot_description"),
        ({"cost_map": True, "cost_map_limits": "nonsense"}, "nonsense"),
        ({"state_file": "/"}, "state_file '/' cannot be used"),
    ],
)
def test_a_node_with_a_wrong_parameter_does_not_start(values, message, capfd):
    use_own_domain()
    import rclpy
    from rclpy.parameter import Parameter

    from rockerbogie.ros.node import RoverNode

    context = rclpy.Context()
    rclpy.init(context=context)
    overrides = [Parameter(name, value=value) for name, value in ({"rover": "osr"} | values).items()]
    node = RoverNode(context=context, parameter_overrides=overrides)
    started = node.start()
    node.destroy_node()
    context.try_shutdown()
    assert not started
    assert message in capfd.readouterr().err


@needs_ros
@pytest.mark.parametrize(
    ("args", "text"),
    [
        ([], "rockerbogie:\n  ros__parameters:\n    cmd_vel_timeout: 1\n"),
        ([], "rockerbogie:\n  ros__parameters:\n    use_imu: 'yes'\n"),
        ([], "rockerbogie:\n  ros__parameters:\n    joint_names: []\n"),
        ([], "rockerbogie:\n  ros__parameters:\n    use_sim_time: 'yes'\n"),
        ([], "rockerbogie: [\n"),
        (["--node-name", "my node"], None),
        (["--namespace", "my space"], None),
        (["--remap", "nonsense"], None),
    ],
)
def test_ros_options_that_ros_refuses_end_with_one_sentence(args, text, tmp_path, capfd):
    use_own_domain()
    if text is not None:
        file = tmp_path / "rover.yaml"
        file.write_text(text, encoding="utf-8")
        args = ["--params", str(file)]
    assert main(["ros", "--rover", "osr", *args]) == 2
    last = capfd.readouterr().err.strip().splitlines()[-1]
    assert "ROS does not start" in last


@needs_ros
def test_unknown_parameters_of_a_file_are_reported(tmp_path, capfd):
    """ROS ignores them silently; those of ROS itself and of other nodes are not reported."""
    use_own_domain()
    import rclpy

    from rockerbogie.ros.node import RoverNode

    file = tmp_path / "rover.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    rover: osr\n    cmd_vel_timout: 1.0\n    use_sim_time: true\n    imu: {frame: ned}\n"
        "    odom_frame: map\n    qos_overrides: {/odom: {publisher: {depth: 3}}}\n"
        "other_node:\n  ros__parameters:\n    speed: 1.0\n",
        encoding="utf-8",
    )
    context = rclpy.Context()
    rclpy.init(context=context, args=["rockerbogie", "--ros-args", "--params-file", str(file)])
    node = RoverNode(context=context)
    names = set(node.get_parameters_by_prefix(""))
    values = {name: node.get_parameter(name).value for name in ("rover", "odom_frame", "use_sim_time", "cmd_vel_timeout")}
    node.destroy_node()
    context.try_shutdown()
    said = [line for line in capfd.readouterr().err.splitlines() if "WARN" in line]
    assert len(said) == 2
    assert "parameter cmd_vel_timout is not known and has no effect; did you mean 'cmd_vel_timeout'?" in said[0]
    assert "parameter imu.frame is not known and has no effect; did you mean 'imu_frame'?" in said[1]
    assert values == {"rover": "osr", "odom_frame": "map", "use_sim_time": True, "cmd_vel_timeout": 0.5}
    assert names >= PARAMETERS.keys()
    assert not names & {"cmd_vel_timout", "imu.frame"}
