"""Tolerances of the kernels: each name has one value and one meaning."""

from __future__ import annotations

# Search of the gap
CONTACT_TIE = 1e-13  # m: contacts whose gaps differ by less tie; rounding decides nothing
GAP_TIE = 1e-12  # m: a minimum that is lower than the lowest by less is not sought; above the rounding of a gap
CELL_MARGIN = 1e-10  # of a cell: margin of comparisons with a cell's sides; above rounding, without effect on the gap
SAME_CONTACT = 1e-7  # rad, and of the radius along the axle: minima closer than this are one, found twice
ONE_CONTACT = 0.01  # of the radius: minima closer than this count as one contact
NEARBY = 1e-3  # of a cell or the radius: distance at which a contact is compared with its surroundings
MIN_CONCAVITY = 1e-9  # 1/m: less concave terrain has no minimum inside a tread that its rims do not have, within 1e-9 m
MIN_DECREASE = 1e-13  # m: Newton's method on a convex part ends when a step lowers the function by less
MIN_COS_TILT = 0.05  # cos τ: at or below it a wheel lies on its side, and no contact is sought
VERIFIED_DEPTH = 1e-10  # m: depth to which bounds may leave a tread below the terrain; a search leaves it twice that

# Body box
CLEARANCE_TIE = 1e-9  # m: a clearance that is lower by less is not sought; all points of flat terrain tie
SMALLEST_PART = 1e-6  # of a cell or an edge: parts are not divided below it; the clearance then differs by less than 1e-9 m

# Solvers
FINAL_GAP = 1e-9  # m: a gap after the last step
CONVERGED_GAP = 1e-10  # m: every gap at convergence of contact mode
SEARCH_GAP = 1e-5  # m: from this gap on, the whole tread is searched at each Newton step
CONTACT_GAP = 1e-6  # m: a gap up to this is a contact that can carry a force
MAX_STEP_ANGLE = 0.3  # rad: longest Newton step
MAX_ANGLE = 1.4  # rad: a pose with a greater roll, pitch or joint angle is a folded linkage and is refused
MAX_ROCKER_ANGLE = 1.6  # rad: no rocker of a settled rover is turned further
LIMIT_MARGIN = 1e-8  # rad: a joint closer to its limit is moved to it
MAX_RESIDUAL = 1e-3  # of the weight (times 1 m for moments): contact forces that leave more do not hold the rover
MIN_ENERGY_DECREASE = 1e-11  # m of the centre of mass: a quadratic program that predicts less has converged
CONSTRAINT_SLACK = 1e-13  # a constraint of a quadratic program may be violated by this, by rounding
