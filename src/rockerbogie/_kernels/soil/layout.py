"""Layout of a packed wheel-soil law, and the codes of laws and results."""

from __future__ import annotations

#: Kinds of laws, element 0 of a packed law.
SOIL, COULOMB, CURVE = range(3)

#: Elements that all laws share.
L_KIND, L_RADIUS = range(2)

#: Elements of SOIL: a rigid wheel on deformable soil.
(
    L_SHEAR_RADIUS,  # radius at which soil shears: the rim plus grousers, m
    L_WIDTH,  # m
    L_COHESION,  # with grousers, Pa
    L_FRICTION,  # tangent of the friction angle, with grousers
    L_STIFFNESS,  # k of p = k z^n, Pa/m^n
    L_EXPONENT,  # n at zero slip
    L_EXPONENT_SLIP,  # growth of n with |slip|
    L_REFERENCE,  # depth at which k keeps its pressure when n changes with slip, m
    L_PEAK,  # a0: angle of peak stress as a fraction of the entry angle, at zero slip
    L_PEAK_DRIVE,  # a1: growth of that fraction with slip, driving
    L_PEAK_SKID,  # the same, skidding
    L_EXIT,  # exit depth as a fraction of the sinkage
    L_EXIT_SLIP,  # growth of that fraction with |slip|
    L_KX,  # shear modulus along the wheel, m
    L_KX_ANGLE,  # growth of kx with |slip angle|, m/rad
    L_KY,  # shear modulus across the wheel, m
    L_KY_ANGLE,  # growth of ky with |slip angle|, m/rad
    L_ISOTROPIC,  # 1: shear stress opposes the displacement, with modulus kx; 0: components by themselves (Ishigami)
    L_BULLDOZE_1,  # side wall: force per metre of rim and metre of depth, N/m²
    L_BULLDOZE_2,  # the same, for the square of the depth, N/m³
    L_DEEPEST,  # largest sinkage of the law, m
) = range(2, 23)
LAW_SIZE = 24

#: Elements of COULOMB: friction on rigid terrain.
L_MU, L_CREEP = 2, 3
#: Elements of CURVE: an empirical slip curve (the creep as COULOMB).
L_RATIO, L_POWER, L_ROLLING, L_CAP = 2, 4, 5, 6

#: Results of a force (`rockerbogie.soil.ForceStatus`).
COMPUTED, OVERLOADED, OUT_OF_RANGE, INVALID, NOT_CONVERGED = range(5)

#: Outputs of a force.
DRAWBAR, SIDE, TORQUE, SINKAGE = range(4)
OUTPUTS = 4

#: Rim speed below which, relative to the wheel's motion, the wheel counts as locked.
LOCKED = 1e-6
