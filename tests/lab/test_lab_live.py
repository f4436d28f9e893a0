"""The page tracks a running robot: any source of poses, and a ROS 2 node on loopback."""

from __future__ import annotations

import math
import queue
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[lab]'")

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.lab.live_panel import table_html
from rockerbogie.lab.server import start_lab
from rockerbogie.logs.live_pose import LivePose
from ros.ros_bench import Bench, needs_ros
from support.browser import PATIENCE, chromium, drag, open_page, pixel_of, text_of, wait_for
from support.lab_page import at_rest, check_numbers, visible

ROVER = rb.load_rover("osr")
TERRAIN = rb.surfaces.rocks(k=0.1, seed=3, size=4.0, spacing=0.04)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as one:
        yield one


def reported(x: float, y: float, yaw: float, **other: Any) -> LivePose:
    """Return a pose as a robot reports it."""
    pose = LivePose(1.0, x, y, 0.0, 0.1, -0.05, yaw, 0.02, np.array([0.03, -0.04]), np.zeros(6), np.zeros(6))
    return replace(pose, **other)


def poses_of(waiting: queue.Queue[Any]) -> Iterator[Any]:
    while (pose := waiting.get()) is not None:
        yield pose


def test_the_table_shows_the_difference_of_robot_and_model() -> None:
    model = rb.settle(ROVER, TERRAIN, 0.1, 0.2, 0.3)
    robot = reported(0.1, 0.2, 0.3, roll=float(model.roll) + math.radians(1.5), pitch=float(model.pitch))
    cells = re.findall(r">(-?[\d.]+)°<", table_html(robot, model))
    assert float(cells[2]) == pytest.approx(1.5, abs=0.006)
    assert float(cells[5]) == 0.0


def test_the_rover_tracks_a_robot_until_it_is_dragged(browser: Any) -> None:
    waiting: queue.Queue[Any] = queue.Queue()
    lab = start_lab(ROVER, TERRAIN, light=True, live=poses_of(waiting))
    try:
        page = open_page(browser, lab.url)
        session = next(iter(lab.sessions.values()))
        wait_for(lambda: "Waiting" in text_of(page, "live"), "the note before the first pose")
        for k in range(5):
            waiting.put(reported(0.05 * k, -0.025 * k, 0.1 * k, time=float(k)))
        wait_for(lambda: session.state.x == 0.2, "the robot's position")
        check_numbers(page, session)
        page.wait_for_selector('[data-key="live"][data-time="4.000"]')
        wait_for(lambda: visible(page, "/ghost/body"), "the ghost")
        assert "5.73°" in text_of(page, "live"), "roll of the robot"
        page.wait_for_function("() => !document.querySelector('.mantine-Notification-root')")
        body = (session.state.x, session.state.y, float(session.state.pose.z) + 0.2)
        drag(page, pixel_of(page, session, body), pixel_of(page, session, np.array(body) + (-0.2, 0.2, 0.0)))
        wait_for(lambda: session.state.x < 0.15 and at_rest(session), "the dragged rover")
        wait_for(lambda: not visible(page, "/ghost/body"), "no ghost")
        x = session.state.x
        waiting.put(reported(-0.3, 0.0, 0.0, time=9.0))
        wait_for(lambda: session.live_panel.pose.time == 9.0, "one more pose")
        assert session.state.x == x
        page.get_by_label("track the robot").click()
        wait_for(lambda: session.state.x == -0.3, "the robot's position again")
        page.close()
    finally:
        waiting.put(None)
        lab.stop()


def shown(page: Any) -> tuple[float, ...]:
    """Return x, y and yaw as the page shows them, in m and degrees."""
    return tuple(float(page.get_by_label(label).input_value()) for label in ("x [m]", "y [m]", "yaw [°]"))


def roll_of_the_model(x: float, y: float, yaw: float) -> str:
    """Return the text of the settled rover's roll at a position in m and a yaw in degrees."""
    return f"{round(math.degrees(float(rb.settle(ROVER, TERRAIN, x, y, math.radians(yaw)).roll)), 2) + 0.0:.2f}°"


@needs_ros
def test_the_command_tracks_a_node_on_loopback(browser: Any, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rclpy.serialization import deserialize_message
    from rosbags.highlevel import AnyReader
    from sensor_msgs.msg import Imu, JointState

    run = rb.drive(ROVER, TERRAIN, rb.Path.straight((0.0, 0.0), 0.0, 0.6), speed=0.1, step=0.005)
    run = run.assign_coords(time=run["time"] + 10.0)  # 0 would be no time
    rb.write_mcap(ROVER, run, tmp_path / "run.mcap")
    with Bench(rover="osr", namespace="/lab") as bench:
        send = {"/joint_states": bench.publisher(JointState, "joint_states"), "/imu": bench.publisher(Imu, "imu/data")}
        command = [sys.executable, "-m", "rockerbogie", "lab", "--no-browser", "--light", "--rover", "osr", "--ros"]
        command += ["--namespace", "/lab", "--terrain", "surface:rocks?k=0.1&seed=3&size=4&spacing=0.04"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout is not None
                url = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
                assert url
                page = open_page(browser, url[0])
                bench.until(lambda: bench.node.odom.get_subscription_count() > 0, "the lab listens")
                bench.until(lambda: send["/joint_states"].get_subscription_count() == 2, "the lab listens to the joints")
                kinds = {"/joint_states": (JointState, "joint states"), "/imu": (Imu, "IMU readings")}
                newest: dict[str, Any] = {}
                with AnyReader([tmp_path / "run.mcap"]) as reader:
                    for connection, _, raw in reader.messages(connections=[c for c in reader.connections if c.topic in kinds]):
                        kind, name = kinds[connection.topic]
                        newest[name] = deserialize_message(bytes(raw), kind)
                        bench.send(send[connection.topic], newest[name], name)
                last = run.isel(time=-1)
                end = pytest.approx((float(last["x"]), float(last["y"]), math.degrees(float(last["yaw"]))), abs=0.05)

                def arrived() -> bool:
                    """Return True if the page shows the end; otherwise publish the standing rover once more."""
                    for topic, (_, name) in kinds.items():  # the page listens without acknowledgement: messages may be lost
                        newest[name].header.stamp.sec += 1
                        bench.send(send[topic], newest[name], name)
                    return shown(page) == end

                wait_for(arrived, "the robot at the end of its drive")
                wait_for(lambda: text_of(page, "roll") == roll_of_the_model(*shown(page)), "the model")
                page.close()
            finally:
                process.send_signal(signal.SIGINT)
                process.wait(PATIENCE)


def test_options_of_ros_without_ros_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lab", "--no-browser", "-t", "surface:plane", "--namespace", "/a"]) == 2
    assert "--ros" in capsys.readouterr().err
