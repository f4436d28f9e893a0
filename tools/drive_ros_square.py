"""Drive a square by cmd_vel: MuJoCo is the robot, the ROS 2 node its odometry and commands.

    python tools/drive_ros_square.py --rover curiosity --seed 2 --side 10

The driver steers by the node's own /odom. Prints the error of the last position of /odom as a share of the distance.
Needs the extra ros2. Simulated time runs as fast as it can (use_sim_time).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import rockerbogie as rb
from rockerbogie.simulation.mjcf import build_spec
from rockerbogie.simulation.rigid_body import Rig

#: Time between messages, s; distance at which a corner is reached, m; largest turn rate, rad/s.
PERIOD, REACHED, TURNING = 0.04, 0.25, 0.1
START_LIFT, STAND, MARGIN = 2e-5, 0.5, 4.0


def wanted(at: np.ndarray, yaw: float, corner: np.ndarray, speed: float) -> tuple[float, float]:
    """Return speed, m/s, and turn rate, rad/s, towards a corner."""
    dx, dy = corner - at
    off = (np.arctan2(dy, dx) - yaw + np.pi) % (2 * np.pi) - np.pi
    if abs(off) > 0.5:
        return 0.0, float(np.copysign(TURNING, off))
    return speed, float(np.clip(0.6 * off, -TURNING, TURNING))


def main() -> None:
    """Run one square and print the result."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rover", default="curiosity")
    options.add_argument("--seed", type=int, default=2)
    options.add_argument("--side", type=float, default=10.0)
    options.add_argument("--speed", type=float, default=0.2)
    options.add_argument("--rocks", type=float, default=0.0, help="area fraction of rocks of surfaces.mars")
    options.add_argument("--friction", type=float, default=1.0)
    options.add_argument("--json", action="store_true")
    given = options.parse_args()
    result = square(given.rover, given.seed, given.side, given.speed, given.friction, given.rocks)
    print(json.dumps(result) if given.json else "\n".join(f"{name}: {value}" for name, value in result.items()))


def square(name: str, seed: int, side: float, speed: float, friction: float, rocks: float) -> dict[str, object]:
    """Drive one square; return distance, error and events."""
    from geometry_msgs.msg import Twist
    from nav_msgs.msg import Odometry
    from rosgraph_msgs.msg import Clock
    from scipy.spatial.transform import Rotation
    from sensor_msgs.msg import Imu, JointState
    from std_msgs.msg import Float64MultiArray

    from ros.ros_bench import Bench

    rover = rb.load_rover(name)
    terrain = rb.surfaces.mars(seed=seed, k=rocks, size=2 * side + 3 * MARGIN)
    corners = np.array([(side, 0), (side, side), (0, side), (0, 0)], dtype=float) - side / 2
    start = corners[-1]
    pose = rb.settle(rover, terrain, *start, 0.0)
    rig = Rig(rover, build_spec(rover, terrain, friction=friction).compile())
    rig.place(pose, START_LIFT)
    rig.step(STAND)
    begin, wall = rig.data.time, time.monotonic()
    joint_names = [f"wheel_{w}_joint" for w in rover.wheel_names]
    joint_names += [f"steer_{w}_joint" for w, on in zip(rover.wheel_names, rover.steers, strict=True) if on]
    joint_names += ["rocker_left_joint", "bogie_left_joint", "bogie_right_joint"]
    x, y, z = rig.data.qpos[:3].tolist()
    with Bench(rover=name, use_sim_time=True, start_position=[x, y, z], steering_rate_limit=0.3) as bench:
        clock = bench.driver.create_publisher(Clock, "/clock", 10)
        send = {
            kind: bench.publisher(message, topic)
            for kind, message, topic in (
                ("joint states", JointState, "joint_states"),
                ("IMU readings", Imu, "imu/data"),
                ("twists", Twist, "cmd_vel"),
            )
        }
        odom = bench.record(Odometry, "odom")
        wheels = bench.record(Float64MultiArray, "wheel_velocity_controller/commands")
        steering = bench.record(Float64MultiArray, "steering_position_controller/commands")
        corner, length, before, worst = 0, 0.0, rig.data.qpos[:3].copy(), 0.0
        turn = np.zeros(6)
        while corner < 4 and rig.data.time - begin < 3 * 4 * side / speed:
            state = rig.record()
            stamp = divmod(round(1e9 * (state.time - begin + 1.0)), 10**9)
            tick, joints, imu = Clock(), JointState(name=joint_names), Imu()
            for part in (tick.clock, joints.header.stamp, imu.header.stamp):
                part.sec, part.nanosec = stamp
            angles = [*state.wheel_angle, *state.steering[rover.steers], state.hinge[0], state.hinge[2], state.hinge[3]]
            joints.position = [float(v) for v in angles]
            q = imu.orientation
            q.w, q.x, q.y, q.z = state.body_pose[3:].tolist()
            spin = imu.angular_velocity
            spin.x, spin.y, spin.z = state.body_velocity[3:].tolist()
            clock.publish(tick)
            bench.send(send["IMU readings"], imu, "IMU readings", 0)
            count = len(odom)
            bench.send(send["joint states"], joints, "joint states", 0)
            bench.until(lambda count=count: len(odom) > count, "odometry")
            p = odom[-1][1].pose.pose
            turned = Rotation.from_quat([p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w])
            yaw = float(turned.as_euler("ZYX")[0])
            at = np.array([p.position.x, p.position.y])
            if np.hypot(*(corners[corner] - at)) < REACHED:
                corner += 1
                if corner == 4:
                    break
            twist = Twist()
            twist.linear.x, twist.angular.z = wanted(at, yaw, corners[corner], speed)
            count = len(wheels), len(steering)
            send["twists"].publish(twist)
            bench.until(lambda count=count: len(wheels) > count[0] and len(steering) > count[1], "commands")
            turn[rover.steers] = steering[-1][1].data
            rig.command(np.array(wheels[-1][1].data), turn)
            rig.step(PERIOD)
            now = rig.data.qpos[:3]
            length += float(np.linalg.norm(now - before))
            before = now.copy()
            del odom[:-5], wheels[:-5], steering[:-5]
        state = rig.record()
        final = np.array([getattr(p.position, k) for k in "xyz"])
        apart = final - state.body_pose[:3]
        sigma = np.sqrt(np.diag(np.reshape(odom[-1][1].pose.covariance, (6, 6)))[:3])
        worst = float(np.linalg.norm(apart))
        events = dict(bench.node.intake.events)
    return {
        "rover": name,
        "terrain": f"mars({seed}, k={rocks:g})",
        "corners reached": corner,
        "distance [m]": round(length, 2),
        "simulated time [s]": round(rig.data.time - begin, 1),
        "error of /odom [m]": round(worst, 4),
        "error [% of the distance]": round(100 * worst / length, 3),
        "stated sigma x, y, z [m]": [round(float(v), 3) for v in sigma],
        "events": events,
        "wall time [s]": round(time.monotonic() - wall, 1),
    }


if __name__ == "__main__":
    main()
