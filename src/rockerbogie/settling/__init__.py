"""Poses of a rover at rest on terrain: solver, results, status codes, uncertainty."""
