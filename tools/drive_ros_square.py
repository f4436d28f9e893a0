"""Drive a square by cmd_vel with the ROS 2 node; MuJoCo is the robot.

    python tools/drive_ros_square.py --rover curiosity --seed 2 --side 10 --share-load --contact-angles

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
from simulated_rover import PERIOD, REACHED, STEERING_RATE, SimulatedRover, angles

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))


def main() -> None:
    """Run one square and print the result."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rover", default="curiosity")
    options.add_argument("--seed", type=int, default=2)
    options.add_argument("--side", type=float, default=10.0)
    options.add_argument("--speed", type=float, default=0.1)
    options.add_argument("--rocks", type=float, default=0.0, help="area fraction of rocks of surfaces.mars")
    options.add_argument("--friction", type=float, default=1.0)
    options.add_argument("--legs", type=int, default=4, help="4: the whole square; fewer: an open track")
    options.add_argument("--share-load", action="store_true", help="parameter share_load of the node")
    options.add_argument("--contact-angles", action="store_true", help="parameter use_contact_angles of the node")
    options.add_argument("--json", action="store_true")
    given = options.parse_args()
    robot = SimulatedRover(given.rover, given.seed, given.rocks, given.side, given.friction)
    parameters = {"share_load": given.share_load, "use_contact_angles": given.contact_angles}
    result = {"rover": given.rover, "terrain": f"mars({given.seed}, k={given.rocks:g})"}
    result |= drive(robot, given.speed, given.legs, parameters)
    print(json.dumps(result) if given.json else "\n".join(f"{name}: {value}" for name, value in result.items()))


def drive(robot: SimulatedRover, speed: float, legs: int, parameters: dict[str, bool]) -> dict[str, object]:
    """Drive to the corners of the square by the node; return distance, error and events."""
    from geometry_msgs.msg import Twist
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, JointState
    from std_msgs.msg import Float64MultiArray

    from ros.ros_bench import Bench

    rover, wall = robot.rover, time.monotonic()
    turning = [w for w, on in zip(rover.wheel_names, rover.steers, strict=True) if on]
    joint_names = [f"wheel_{w}_joint" for w in rover.wheel_names] + [f"steer_{w}_joint" for w in turning]
    joint_names += ["rocker_left_joint", "bogie_left_joint", "bogie_right_joint"]
    x, y, z = robot.position.tolist()
    options = {"use_sim_time": True, "start_position": [x, y, z], "steering_rate_limit": STEERING_RATE} | parameters
    options["command_rate"] = 0.4 / PERIOD  # only twists give commands: a run is the same on a busy machine
    with Bench(rover=rover.name, **options) as bench:
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
        corner, last, turn = 0, 0.0, np.zeros(6)
        side = float(np.abs(robot.corners).max()) * 2
        while corner < legs and last < 3 * legs * side / speed:
            now = robot.read()
            last = now.time
            joints, imu = JointState(name=joint_names), Imu()
            for stamp in (joints.header.stamp, imu.header.stamp):
                stamp.sec, stamp.nanosec = divmod(round(1e9 * (now.time + 1.0)), 10**9)
            joints.position = [float(v) for v in (*now.wheel_angle, *now.steering[rover.steers], *now.suspension)]
            joints.effort = [*now.effort.tolist(), *[float("nan")] * (len(joint_names) - 6)]
            q, spin = imu.orientation, imu.angular_velocity
            q.x, q.y, q.z, q.w = now.quaternion.tolist()
            spin.x, spin.y, spin.z = now.gyro.tolist()
            bench.set_time(now.time + 1.0)
            bench.send(send["IMU readings"], imu, "IMU readings", 0)
            count = len(odom)
            bench.send(send["joint states"], joints, "joint states", 0)
            bench.until(lambda count=count: len(odom) > count, "odometry")
            p = odom[-1][1].pose.pose
            yaw = angles(np.array([p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w]))[2]
            at = np.array([p.position.x, p.position.y])
            if np.hypot(*(robot.corners[corner] - at)) < REACHED:
                corner += 1
                if corner == legs:
                    break
            twist = Twist()
            twist.linear.x, twist.angular.z = robot.wanted(at, yaw, corner, speed)
            count = len(wheels), len(steering)
            send["twists"].publish(twist)
            bench.until(lambda count=count: len(wheels) > count[0] and len(steering) > count[1], "commands")
            turn[rover.steers] = steering[-1][1].data
            robot.move(np.array(wheels[-1][1].data), turn)
            del odom[:-5], wheels[:-5], steering[:-5]
        final = np.array([getattr(p.position, k) for k in "xyz"])
        apart = float(np.linalg.norm(final - robot.position))
        sigma = np.sqrt(np.diag(np.reshape(odom[-1][1].pose.covariance, (6, 6)))[:3])
        events = dict(bench.node.intake.events)
    return {
        "corners reached": corner,
        "distance [m]": round(robot.length, 2),
        "simulated time [s]": round(last, 1),
        "error of /odom [m]": round(apart, 4),
        "error [% of the distance]": round(100 * apart / robot.length, 3),
        "stated sigma x, y, z [m]": [round(float(v), 3) for v in sigma],
        "commands every [s]": PERIOD,
        "events": events,
        "wall time [s]": round(time.monotonic() - wall, 1),
    }


if __name__ == "__main__":
    main()
