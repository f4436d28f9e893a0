"""Layout of a packed wheel-soil law, and the codes of laws and results."""

from __future__ import annotations

#: Kinds of laws, element 0 of a packed law.
SOIL, COULOMB, CURVE = range(3)

#: Elements that all laws share.
L_KIND, L_RADIUS = range(2)

#: Elements of SOIL: a rigid wheel on deformable soil. EXPONENT, PEAK and EXIT are `TERMS` numbers each (`stress.contact_term`).
(
    L_WIDTH,  # m
    L_COHESION,  # with grousers, Pa
    L_FRICTION,  # tangent of the friction angle, with grousers
    L_STIFFNESS,  # k of p = k z^n, Pa/m^n
    L_KX,  # shear modulus along the wheel, m
    L_KX_ANGLE,  # growth of kx with |slip angle|, m/rad
    L_KY,  # shear modulus across the wheel, m
    L_KY_ANGLE,  # growth of ky with |slip angle|, m/rad
    L_COUPLED,  # 1: shear stress opposes the displacement; 0: its components by themselves (Ishigami)
    L_BULLDOZE_1,  # side wall: force per metre of rim and metre of depth, N/m²
    L_BULLDOZE_2,  # the same, for the square of the depth, N/m³
    L_DEEPEST,  # largest sinkage of the law, m
    L_TRAVEL,  # 1: slip relative to the speed of travel; 0: relative to the speed along the heading
    L_LUG,  # grouser height over radius
    L_LUG_EXPONENT,  # growth of n with lug × slip², driving
    L_LUG_EXIT,  # the same of the exit fraction
) = range(2, 18)
#: Terms of a quantity that depends on slip s and side motion y: 1, s, s², y, y s, y s².
TERMS = 6
L_EXPONENT, L_PEAK, L_EXIT = 18, 24, 30
LAW_SIZE = 36

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
