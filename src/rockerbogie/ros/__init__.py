"""ROS 2 node of a rover: odometry, wheel commands and state (docs/ros.md)."""
