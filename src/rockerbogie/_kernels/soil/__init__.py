"""Kernels of wheel-soil laws: stresses, load balance, tabulated forces (docs/soil.md)."""
