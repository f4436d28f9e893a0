"""Odometry: motion of one interval between readings, and the track."""
