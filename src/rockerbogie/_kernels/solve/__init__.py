"""Solvers for one pose: six contacts, or static equilibrium."""
