"""The numeric core: numba only, scalar maths first, one parallel loop over the batch above it."""
