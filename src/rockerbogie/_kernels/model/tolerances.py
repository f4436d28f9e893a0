"""Tolerances of the kernels: each name has one value and one meaning."""

from __future__ import annotations

CONTACT_TIE = 1e-13  # m
SAME_CONTACT = 1e-7  # rad, and of the radius along the axle: minima of the gap nearer than this are one, found twice
GAP_TIE = 1e-12  # m: a gap lower by less is not looked for
CELL_MARGIN = 1e-10  # of a cell: more than rounding, and nothing to the gap
VERIFIED_DEPTH = 1e-9  # m: what a searched tread may lie in the ground
FINAL_GAP = 1e-9  # m: what a gap may be after the last step
MAX_STEP_ANGLE = 0.3  # rad, the longest step
MAX_ROCKER_ANGLE = 1.6  # rad: no linkage stands so far from rest
