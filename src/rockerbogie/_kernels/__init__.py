"""Compiled kernels: models, searches, solvers of one pose and of 16 (SIMD), batch loops."""
