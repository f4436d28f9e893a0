"""The ROS 2 node on loopback: odometry of a replayed bag, commands, faults, lifecycle."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest

import rockerbogie as rb
from ros.ros_bench import PATIENCE, Bench, needs_ros, use_own_domain
from support.helpers import assert_close

pytestmark = needs_ros
ROVER = rb.load_rover("osr")
HZ = 50


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """Return a run over rocks, its MCAP file, and batch odometry of that file."""
    pytest.importorskip("rosbags")
    run = rb.drive(ROVER, rb.surfaces.mars(seed=2), rb.Path.arc((0.0, 0.0), 0.0, 2.0, 0.15), speed=0.1, step=0.1 / HZ)
    run = run.isel(time=slice(0, 4 * HZ))  # 4 s
    run = run.assign_coords(time=run["time"] + 10.0)
    file = tmp_path_factory.mktemp("bag") / "run.mcap"
    rb.write_mcap(ROVER, run, file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rb.LogWarning)
        return run, file, rb.odometry(ROVER, None, rb.read_log(file, ROVER))


def stored_messages(file):
    """Yield topic, time and message of a bag, the messages as rclpy has them."""
    from rclpy.serialization import deserialize_message
    from rosbags.highlevel import AnyReader
    from sensor_msgs.msg import Imu, JointState

    kinds = {"/joint_states": JointState, "/imu": Imu}
    with AnyReader([file]) as reader:
        for connection, time_ns, raw in reader.messages(connections=[c for c in reader.connections if c.topic in kinds]):
            yield connection.topic, 1e-9 * time_ns, deserialize_message(bytes(raw), kinds[connection.topic])


def stamps(messages):
    return np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for _, m in messages])


def positions(messages):
    return np.array([[getattr(m.pose.pose.position, k) for k in "xyz"] for _, m in messages])


@pytest.mark.parametrize("speed", [1, 10])
def test_a_replayed_bag_gives_the_batch_odometry(bag, speed):
    """Replay a recorded MCAP file: pose, twist and covariances are those of `odometry`."""
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, JointState

    _, file, track = bag
    with Bench(rover="osr") as bench:
        bench.node.intake.patience = 1_000_000  # every IMU reading comes; on a busy machine it may come late
        send = {"/joint_states": bench.publisher(JointState, "joint_states"), "/imu": bench.publisher(Imu, "imu/data")}
        odom = bench.record(Odometry, "odom")
        begin, first = time.monotonic(), None
        for topic, at, message in stored_messages(file):
            first = at if first is None else first
            bench.spin(max((at - first) / speed - (time.monotonic() - begin), 0.0))
            bench.send(send[topic], message, "joint states" if topic == "/joint_states" else "IMU readings", 40)
        bench.until(lambda: len(odom) >= track.sizes["time"], "estimate of the last row")
        events = dict(bench.node.intake.events)
    assert not events
    assert_close(
        stamps(odom) - stamps(odom)[0], track["time"].values - float(track["time"][0]), 1e-6, "s", "stamps of the readings"
    )
    assert_close(positions(odom), np.stack([track[k] for k in "xyz"], axis=-1), 1e-9, "m", "position")
    covariance = np.array([m.pose.covariance for _, m in odom]).reshape(-1, 6, 6)
    assert_close(covariance, track["pose_covariance"].values, 1e-12, "SI", "covariance of the pose")
    twist = np.array(
        [[getattr(getattr(m.twist.twist, part), k) for part in ("linear", "angular") for k in "xyz"] for _, m in odom]
    )
    assert_close(twist[1:], track["twist"].values[1:], 1e-9, "SI", "twist")
    assert odom[0][1].header.frame_id == "odom"
    assert odom[0][1].child_frame_id == "base_link"


def test_commands_are_those_of_the_controller():
    """Send twists at 50 Hz: commands come in the robot's names and signs."""
    from geometry_msgs.msg import Twist
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    names = ["drive_fl=wheel_LF_joint", "drive_fr=-wheel_RF_joint", "turn_fl=-steering_LF"]
    want = rb.WheelController(ROVER)
    command = [want.command([0.05, 0.0, 0.04]) for _ in range(3)][-1]
    index = {name: k for k, name in enumerate(ROVER.wheel_names)}
    signs = np.ones(6)
    signs[index["RF"]] = -1.0
    angles = (np.where(np.arange(6) == index["LF"], -1.0, 1.0) * command.steering)[ROVER.steers]
    with Bench(rover="osr", joint_names=names, steering_rate_limit=0.5) as bench:
        send = bench.publisher(Twist, "cmd_vel")
        wheels = bench.record(Float64MultiArray, "wheel_velocity_controller/commands")
        steering = bench.record(Float64MultiArray, "steering_position_controller/commands")
        joint = bench.record(JointState, "joint_commands")
        twist = Twist()
        twist.linear.x, twist.angular.z = 0.05, 0.04

        def turned():
            send.publish(twist)
            bench.spin(1.0 / HZ)
            return bool(joint) and np.allclose(joint[-1][1].position[6:], angles, rtol=0, atol=1e-6)

        bench.until(turned, "the wheels at their angles")
        bench.until(lambda: not np.any(wheels[-1][1].data), "stop after the last twist")
        bench.until(lambda: len(wheels) == len(joint) == len(steering), "the last commands")
    moving = np.array([m.data for _, m in wheels])
    moving = moving[np.any(moving != 0.0, axis=1)]
    assert_close(moving[-1], signs * command.wheel_rates, 1e-6, "rad/s", "wheel rates once the wheels have turned")
    assert np.abs(wheels[0][1].data).max() < 0.1 * np.abs(moving[-1]).max(), "the rover waits for its wheels"
    last = joint[-1][1]
    assert last.name[index["LF"]] == "drive_fl"
    assert dict(zip(last.name, last.position, strict=True))["turn_fl"] == pytest.approx(-command.steering[index["LF"]], abs=1e-6)
    assert list(steering[-1][1].data) == list(last.position[6:])


def test_efforts_of_joint_states_share_the_load():
    """Send efforts: rates change by the controller's rule until the efforts are stale."""
    from geometry_msgs.msg import Twist
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    names = ["drive_fr=-wheel_RF_joint"]
    effort = np.array([0.6, -0.2, 0.1, 0.0, float("nan"), 0.0])
    index = {name: k for k, name in enumerate(ROVER.wheel_names)}
    signs = np.ones(6)
    signs[index["RF"]] = -1.0
    with Bench(rover="osr", joint_names=names, share_load=True, use_imu=False, use_sim_time=True) as bench:
        send = bench.publisher(Twist, "cmd_vel")
        joints = bench.publisher(JointState, "joint_states")
        wheels = bench.record(Float64MultiArray, "wheel_velocity_controller/commands")
        twist = Twist()
        twist.linear.x = 0.05
        message = JointState(name=[f"wheel_{w}_joint" if w != "RF" else "drive_fr" for w in ROVER.wheel_names])
        message.position, message.effort = [0.0] * 6, (signs * effort).tolist()
        bench.set_time(100.0)
        message.header.stamp.sec = 100
        bench.send(joints, message, "joint states", 0)
        send.publish(twist)
        bench.until(lambda: len(wheels) == 1, "commands")
        first = np.array(wheels[0][1].data)
        bench.set_time(100.49)  # no twist is older than 0.5 s
        bench.until(lambda: len(wheels) == 2, "the command again")
        shared = np.array(wheels[1][1].data)
        send.publish(twist)
        bench.until(lambda: len(wheels) == 3, "commands")
        bench.set_time(100.51)
        bench.until(lambda: len(wheels) == 4, "the command without efforts")
        stale = np.array(wheels[3][1].data)
        message.effort = [1.0]
        message.header.stamp.sec = 101
        bench.send(joints, message, "joint states", 0)
        assert "joint states" in bench.node._logged, "efforts of another number are reported"
    plain = rb.WheelController(ROVER).command([0.05, 0.0, 0.0]).wheel_rates
    want = rb.WheelController(ROVER).command([0.05, 0.0, 0.0], dt=0.02, effort=effort).wheel_rates
    assert_close(first, signs * want, 1e-9, "rad/s", "rates with the load shared")
    assert np.abs(want - plain).max() > 0.01 * plain.max(), "efforts change the rates"
    assert np.abs(shared - signs * plain).max() > 0.01 * plain.max(), "efforts of 0.49 s ago are used"
    assert_close(stale, signs * plain, 1e-9, "rad/s", "efforts older than 0.5 s are not used")


def test_the_node_survives_faulty_sensors_and_reports_them(bag):
    """Lose, double and spoil messages, set the clock back, restart counters, end the IMU."""
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, JointState

    _, file, track = bag
    messages = list(stored_messages(file))
    joints = [m for topic, _, m in messages if topic == "/joint_states"]
    imus = [m for topic, _, m in messages if topic == "/imu"]
    n = len(joints)

    def shifted(message, seconds, angle=0.0):
        ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec + round(1e9 * seconds)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(ns, 10**9)
        for k, name in enumerate(getattr(message, "name", ())):
            if name.startswith("wheel"):
                message.position[k] += angle
        return message

    with Bench(rover="osr", sensor_timeout=2 * PATIENCE) as bench:
        joint, imu = bench.publisher(JointState, "joint_states"), bench.publisher(Imu, "imu/data")
        odom, state = bench.record(Odometry, "odom"), bench.record(DiagnosticArray, "rover/state")

        def send(k, seconds=100.0, angle=0.0, attitude=True):
            if attitude:
                bench.send(imu, shifted(imus[k], seconds), "IMU readings")
            bench.send(joint, shifted(joints[k], seconds, angle), "joint states")

        quarter = n // 4
        for k in range(quarter):
            if k % 7 != 3:  # loss
                send(k)
        bench.send(joint, joints[quarter - 1], "joint states", 0)  # duplicate
        bench.send(joint, joints[quarter - 3], "joint states", 0)  # late
        bad = shifted(JointState(header=joints[0].header, name=joints[0].name, position=joints[0].position), 1e-3)
        bad.header.stamp.sec += 300
        bad.position[list(bad.name).index("wheel_LF_joint")] = float("nan")
        bench.send(joint, bad, "joint states", 0)
        for k in range(quarter, 2 * quarter):  # the clock is set back by 50 s, and the counters start again
            send(k, 50.0, angle=-300.0)
        for k in range(2 * quarter, n):  # no IMU
            send(k, 50.0, angle=-300.0, attitude=False)

        def reported():
            return next(s for s in state[-1][1].status if s.name.endswith("sensors"))

        bench.until(lambda: state and "no IMU" in reported().message, "report of the missing IMU")
        sensors = reported()
        last = joints[-1].header.stamp
        bench.until(lambda: odom and odom[-1][1].header.stamp == last, "estimate of the last row")
        found = {pair.key: pair.value for pair in sensors.values}
        end = positions(odom)[-1]
    assert {"duplicate", "late", "not finite", "clock set", "counter jump", "no IMU"} <= found.keys(), found
    assert "set back by" in found["last clock set"]
    assert sensors.level == b"\x01"
    assert np.isfinite(positions(odom)).all()
    want = np.array([float(track[k][-1]) for k in "xyz"])
    error = np.linalg.norm(end - want) / float(track["distance_3d"][-1])
    assert error < 0.05, f"after all that the position is off by {100 * error:.1f} % of the distance"


def test_the_description_may_come_by_topic_and_is_published():
    """Start without a rover: it is read from robot_description, in a namespace."""
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    with Bench(namespace="/rover1") as bench:
        assert bench.node.rover is None
        publisher = bench.driver.create_publisher(String, "robot_description", latched)
        publisher.publish(String(data=rb.to_urdf(ROVER)))
        bench.until(lambda: bench.node.active, "start after the description")
        assert bench.node.rover.wheel_names == ROVER.wheel_names
        wanted = {"/rover1/odom", "/rover1/joint_states", "/rover1/rover/state"}
        bench.until(lambda: wanted <= {name for name, _ in bench.node.get_topic_names_and_types()}, "topics in the namespace")
        assert bench.publisher(JointState, "joint_states")
    with Bench(rover="osr", publish_robot_description=True) as bench:
        found = bench.record(String, "robot_description", latched)
        bench.until(lambda: found, "latched description")
        assert rb.load_rover("osr").wheel_names == ROVER.wheel_names
        assert "<robot" in found[0][1].data


def test_the_lifecycle_and_its_refusals():
    """Go through all transitions; wrong parameters are refused when the node is configured."""
    from rclpy.lifecycle import TransitionCallbackReturn as Result
    from rclpy.parameter import Parameter

    with Bench(start=False, rover="nonsense") as bench:
        assert bench.node.trigger_configure() == Result.FAILURE
        assert bench.node.set_parameters([Parameter("rover", value="osr")])[0].successful
        assert bench.node.trigger_configure() == Result.SUCCESS
        refused = bench.node.set_parameters([Parameter("rover", value="curiosity")])[0]
        assert not refused.successful
        assert "clean it up first" in refused.reason
        assert bench.node.set_parameters([Parameter("cmd_vel_timeout", value=1.0)])[0].successful
        assert bench.node.value("cmd_vel_timeout") == 1.0
        assert bench.node.trigger_activate() == Result.SUCCESS
        assert bench.node.trigger_deactivate() == Result.SUCCESS
        assert bench.node.trigger_cleanup() == Result.SUCCESS
        assert bench.node.rover is None
        assert bench.node.trigger_configure() == Result.SUCCESS
        assert bench.node.trigger_shutdown() == Result.SUCCESS
    with Bench(rover="osr", imu_frame="up") as bench:
        assert not bench.started
    with Bench(rover="osr", command_rate=40.0, state_rate=20.0) as bench:
        assert {timer.timer_period_ns for timer in bench.node.timers} == {25_000_000, 50_000_000}


def test_a_track_continues_from_its_state_file(bag, tmp_path):
    """Save the track on deactivation; another node continues it to the same end."""
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, JointState

    _, file, track = bag
    messages = list(stored_messages(file))
    state = tmp_path / "state.json"
    ends = []
    cut = len(messages) // 4 * 2  # after an IMU reading
    for part in (messages[:cut], messages[cut:]):
        with Bench(rover="osr", state_file=str(state)) as bench:
            send = {"/joint_states": bench.publisher(JointState, "joint_states"), "/imu": bench.publisher(Imu, "imu/data")}
            odom = bench.record(Odometry, "odom")
            count = sum(topic == "/joint_states" for topic, _, _ in part)
            for topic, _, message in part:
                bench.send(send[topic], message, "joint states" if topic == "/joint_states" else "IMU readings")
            bench.until(lambda odom=odom, count=count: len(odom) >= count, "estimate of the last row")
            ends.append(positions(odom)[-1])
            bench.node.trigger_deactivate()
    assert state.exists()
    assert_close(ends[-1], [float(track[k][-1]) for k in "xyz"], 1e-9, "m", "end of the whole track")
    state.write_text('{"mine": 1}', encoding="utf-8")
    with Bench(rover="osr", state_file=str(state)) as bench:
        assert not bench.started
        assert state.read_text(encoding="utf-8") == '{"mine": 1}'


def test_the_command_runs_the_node_until_it_is_interrupted():
    """Run `rockerbogie ros` as a process: it takes simulated time and ends with code 0."""
    import rclpy
    from rosgraph_msgs.msg import Clock

    use_own_domain()
    command = [
        sys.executable,
        "-m",
        "rockerbogie",
        "ros",
        "--rover",
        "osr",
        "--namespace",
        "r2",
        "--use-sim-time",
        "--set",
        "state_rate=20",
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        from diagnostic_msgs.msg import DiagnosticArray

        node = rclpy.create_node("watcher", context=context)
        executor = rclpy.executors.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        found = []
        node.create_subscription(DiagnosticArray, "/r2/rover/state", found.append, 10)
        clock = node.create_publisher(Clock, "/clock", 10)
        end, tick = time.monotonic() + PATIENCE, 0
        while not found and time.monotonic() < end and process.poll() is None:
            tick += 1
            message = Clock()
            message.clock.sec = 5000 + tick
            clock.publish(message)
            executor.spin_once(timeout_sec=0.05)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
        assert found, errors
        assert 5000 < found[0].header.stamp.sec < 5000 + tick + 1
    finally:
        process.kill()
        context.try_shutdown()
    assert process.returncode == 0, errors


def test_a_live_view_gets_the_poses(bag):
    """Listen to a node's topics in another thread: pose and joints are those published."""
    from sensor_msgs.msg import Imu, JointState

    from rockerbogie.ros.poses import LivePoses

    run, file, track = bag
    with Bench(rover="osr", namespace="/r3") as bench, LivePoses(ROVER, namespace="/r3") as view:
        send = {"/joint_states": bench.publisher(JointState, "joint_states"), "/imu": bench.publisher(Imu, "imu/data")}
        for topic, end in (("joint_states", send["/joint_states"]), ("odom", bench.node.odom)):
            seen = next(s for s in view._node.subscriptions if s.topic_name == f"/r3/{topic}")
            count = 2 if topic == "joint_states" else 1  # the node is subscribed too
            bench.until(lambda end=end, count=count: end.get_subscription_count() == count, f"a view of {topic}")
            bench.until(lambda seen=seen: seen.get_publisher_count() > 0, f"{topic} in the view")
        end = 10.0 + 1e-9 * round(1e9 * float(run["time"][-1] - 10.0))
        for topic, _, message in stored_messages(file):
            bench.send(send[topic], message, "joint states" if topic == "/joint_states" else "IMU readings")
        bench.until(lambda: view.newest is not None and view.newest.time > end - 1e-3, "the last pose")
        pose = next(iter(view))
        want = track.isel(time=int(np.argmin(np.abs(track["time"].values - pose.time))))
        assert_close([pose.x, pose.y, pose.z], [float(want[k]) for k in "xyz"], 1e-6, "m", "position")
        assert_close([pose.roll, pose.pitch], [float(want["roll"]), float(want["pitch"])], 1e-6, "rad", "attitude")
        assert_close(pose.bogie, run["bogie"].values[-1], 0.02, "rad", "bogies")
