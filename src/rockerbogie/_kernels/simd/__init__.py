"""Solvers for a block of poses, one pose per SIMD lane."""
