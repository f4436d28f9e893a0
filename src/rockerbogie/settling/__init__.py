"""Poses of a rover on terrain: solver, results, status codes, uncertainty."""
