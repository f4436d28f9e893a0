"""Motion at a pose and along a path: Jacobians, body twist, wheel commands, slip, drives."""
