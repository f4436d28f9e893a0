"""Measure the latency that the ROS 2 node adds between cmd_vel and wheel commands.

    python tools/ros_latency.py --rover curiosity --count 1000

A relay that only publishes what it receives, in the place of the node, gives the latency of ROS itself; the difference is
added by the node. Also prints the processor time of one callback. Needs the extra ros2.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))


def main() -> None:
    """Print percentiles of the relay, the node and the difference."""
    from geometry_msgs.msg import Twist
    from std_msgs.msg import Float64MultiArray

    from ros.ros_bench import Bench

    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rover", default="curiosity")
    options.add_argument("--count", type=int, default=1000)
    given = options.parse_args()
    with Bench(rover=given.rover) as bench:
        relay = bench.driver.create_publisher(Float64MultiArray, "relayed", 10)
        bench.driver.create_subscription(Twist, "to_relay", lambda m: relay.publish(Float64MultiArray(data=[m.linear.x] * 6)), 10)
        results = {}
        for name, there, back in (
            ("relay", "to_relay", "relayed"),
            ("node", "cmd_vel", "wheel_velocity_controller/commands"),
        ):
            send, answers, taken = bench.publisher(Twist, there), bench.record(Float64MultiArray, back), []
            for k in range(given.count):
                twist = Twist()
                twist.linear.x, twist.angular.z = 0.05, 0.02 * np.sin(0.01 * k)
                count, begin = len(answers), time.perf_counter()
                send.publish(twist)
                bench.until(lambda n=count, a=answers: len(a) > n, "an answer")
                taken.append(answers[count][0] - begin)
                bench.spin(max(0.02 - (time.perf_counter() - begin), 0.0))
            results[name] = 1e3 * np.array(taken)
        own = []
        for _ in range(given.count):
            begin = time.process_time()
            bench.node.commands.take(twist)
            own.append(1e3 * (time.process_time() - begin))
    for name, values in (*results.items(), ("processor time of a callback", np.array(own))):
        p50, p90, p99 = np.percentile(values, (50, 90, 99))
        print(f"{name}: median {p50:.2f} ms, 90 % {p90:.2f} ms, 99 % {p99:.2f} ms")
    added = np.percentile(results["node"], 99) - np.percentile(results["relay"], 99)
    print(f"added at the 99th percentile: {added:.2f} ms")


if __name__ == "__main__":
    main()
