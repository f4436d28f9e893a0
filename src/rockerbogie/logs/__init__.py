"""Logs of rovers: reading, odometry, and comparison with predictions."""
