"""Quasi-static motion of a rover from the forces on its wheels."""
