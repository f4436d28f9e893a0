"""Compilation and memory access: the only kernel modules that import numba or llvmlite."""
