"""Rigid-body simulation in MuJoCo, and comparison with settled poses."""
