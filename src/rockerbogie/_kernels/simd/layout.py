"""Layout of the lane array, which holds all numbers of a block of poses.

The array is flat. A row holds one number for each lane, at `lanes[POSE.x + l]`, or one for each wheel and lane, at
`lanes[WHEEL.fx + i * LANES + l]` for wheel i. Rows start at constants and the innermost loops run over lanes alone: so the
compiler can derive that rows do not overlap, and turns these loops into vector instructions.

The first number of the array is the number of lanes in use, `lanes[WIDTH]`: `LANES`, or `HALF` if a block has no more poses or
wheels. Loops over lanes end there (`in_use`), and no number of a lane beyond is read.

Each group of rows is a NamedTuple. In its class, the value after a field is the size of the row; in its instance, the
value is the start of the row. The cubic and the bilinear solver have a lane array each, with the common groups first.

Flags are 1.0 or 0.0. Lengths are m, angles rad, slopes m/m. Positions (x, y) are measured from the map's first node, heights
from the map's datum.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined
from ..jit.rows import place_rows

Array = NDArray[np.float64]

HALF = 8  # lanes that one instruction of the widest vectors takes
LANES = 2 * HALF  # poses in a block
ALL = 6 * LANES  # size of a row with a number for each wheel
LINE = 8  # numbers in a cache line of the processor

WIDTH = 0  # index of the number of lanes in use
EDGE = 1  # index of a flag: not 0 if a rover of the block may reach the map's edge

COLUMNS = 48  # columns of cells under one rim, at most
SIDE = 48  # grid nodes under one wheel along x or y, at most
ROOM = SIDE * SIDE


class PoseRows(NamedTuple):
    """Pose, Newton step and body."""

    x: int = LANES  # position of the body's reference point
    y: int = LANES
    yaw: int = LANES  # heading; 0 where it is too large for `sine_cosine`
    cy: int = LANES  # cos yaw
    sy: int = LANES  # sin yaw
    q: int = 6 * LANES  # unknowns: z, roll, pitch, left rocker angle, left and right bogie angles; 0 before the first step
    step: int = 6 * LANES  # Newton step of q; NaN where the Jacobian is singular
    active: int = LANES  # flag: the pose is still iterated
    worst: int = LANES  # largest |component| of the last step; infinite if the step is not finite
    axes: int = 9 * LANES  # x, y and z axes of the body in the world, one after another
    right: int = LANES  # right rocker angle
    rate: int = LANES  # derivative of the right rocker angle by the left one


class WheelRows(NamedTuple):
    """Linkage, hub and axle of each wheel."""

    fx: int = ALL  # hub from its pivot, in the frame of its link (`hub_offsets`; these five rows keep its order)
    fy: int = ALL
    fz: int = ALL
    fc: int = ALL  # cos of the steering angle
    fs: int = ALL  # sin of the steering angle
    lc: int = ALL  # cos of the link's angle to the body
    ls: int = ALL  # sin of the link's angle to the body
    bx: int = ALL  # x of the link's pivot in the body
    bz: int = ALL  # z of the link's pivot in the body
    br: int = ALL  # derivative of the wheel's rocker angle by the left one: 1, or POSE.rate on the right
    ox: int = ALL  # hub from the body's reference point, in the world; `cubic_newton.start` writes 0 for wheel 0
    oy: int = ALL
    oz: int = ALL
    az: int = ALL  # z of the axle's direction, positive to the left
    vx: int = ALL  # horizontal direction of the axle, of length 1
    vy: int = ALL
    uz: int = ALL  # horizontal length of the axle's direction: sqrt(1 - az²)


class ContactRows(NamedTuple):
    """Contact point of each wheel."""

    sine: int = ALL  # sin φ of the position on the rim; 0 under the hub, positive ahead of it
    cosine: int = ALL  # cos φ, positive on the lower half
    offset: int = ALL  # position along the axle from the wheel's middle, within ± half the width
    tx: int = ALL  # contact point from the hub, in the world; `cubic_newton.start` writes 0 for wheel 0
    ty: int = ALL
    tz: int = ALL
    gx: int = ALL  # slope of the contact along x
    gy: int = ALL  # slope of the contact along y
    gap: int = ALL  # tread minus terrain there; infinite where the search found no terrain
    by_roll: int = ALL  # derivative of the gap by roll
    by_pitch: int = ALL  # derivative of the gap by pitch
    by_rocker: int = ALL  # derivative of the gap by the left rocker angle
    by_bogie: int = ALL  # derivative of the gap by the bogie angle of its side; not used of wheels 0 and 1


class CubicRows(NamedTuple):
    """Cubic terrain under each contact, and the state of the pose."""

    u: int = ALL  # contact in its cell along x, in cells; beyond 0 to 1 off the map
    v: int = ALL  # contact in its cell along y
    col: int = ALL  # cell under the contact, on the map
    row: int = ALL
    coef: int = 16 * ALL  # spline coefficients of the cell, 4 × 4 row by row, each for all wheels
    h: int = ALL  # height
    hxx: int = ALL  # second derivatives of the height, 1/m
    hxy: int = ALL
    hyy: int = ALL
    turn: int = ALL  # last movement of the contact: |Δφ| + |Δoffset| / reach
    rejected: int = ALL  # flag: the wheel or its contact has left the range in which the method is valid
    sound: int = LANES  # flag: converged, in the range in which the method is valid, with no angle beyond MAX_ANGLE
    verdict: int = LANES  # result of `verify_minimum`: LEAST, LOWER or UNKNOWN
    first_sine: int = LANES  # contact on the tangent plane under the body: sin φ
    first_cosine: int = LANES  # cos φ


class BoundRows(NamedTuple):
    """Lowest of a lane's lower bounds."""

    low: int = LANES  # lower bound (m); infinite: nothing left; TRACKED: the cell is given
    piece: int = LANES  # index of the piece that has it


class RimRows(NamedTuple):
    """Rim of one wheel in grid coordinates (p, t), in cells.

    p is the axis along which the rim covers more cells. On the rim, p = p0 + a sin φ + b cos φ, t = t0 + c sin φ + d cos φ,
    z = zr - rho cos φ.
    """

    offset: int = LANES  # position of the rim along the axle
    p0: int = LANES  # middle of the rim along p
    t0: int = LANES  # middle of the rim along t
    a: int = LANES
    b: int = LANES
    c: int = LANES
    d: int = LANES
    rho: int = LANES  # vertical radius
    zr: int = LANES  # height of the middle
    h2: int = LANES  # a² + b²
    q2: int = LANES  # c² + d²
    far_t: int = LANES  # sqrt(q2): greatest |t - t0|
    over_h: int = LANES  # 1 / h2
    over_q: int = LANES  # 1 / (q2 + 1e-30)
    ac: int = LANES  # a c
    bd: int = LANES  # b d
    e: int = LANES  # a d + b c
    swap: int = LANES  # flag: p is y
    sign: int = LANES  # 1 or −1: sign of φ that makes a positive
    low_p: int = LANES  # lowest p − p0 of the lower half
    high_p: int = LANES  # highest p − p0 of the lower half
    first: int = LANES  # first column of cells under the rim
    more: int = LANES  # number of columns less one


class ColumnRows(NamedTuple):
    """Arc of the rim over one column of cells.

    It has a piece over the cell it enters and one over the cell it leaves.
    """

    s_in: int = LANES  # sin φ where the rim enters the column
    c_in: int = LANES  # cos φ there
    t_in: int = LANES  # t there
    s_mid: int = LANES  # sin φ where it crosses into the next cell; where it leaves if it crosses into none
    c_mid: int = LANES
    s_out: int = LANES  # sin φ where it leaves the column
    c_out: int = LANES
    t_out: int = LANES
    cell_in: int = LANES  # t of the cell it enters
    cell_out: int = LANES  # t of the cell it leaves
    bound_in: int = LANES  # lower bound of the gap over the first piece
    bound_out: int = LANES  # lower bound of the gap over the second piece
    cell_turn: int = LANES  # t of the cell in which the rim turns back
    beyond: int = LANES  # flag: that is a third cell
    s_into: int = LANES  # sin φ where it enters the third cell, or the column if that is later
    c_into: int = LANES
    s_back: int = LANES  # sin φ where it leaves the third cell, or the column if that is earlier
    c_back: int = LANES
    low_beyond: int = LANES  # lower bound of the gap over the third cell


class CellRows(NamedTuple):
    """Cell of the grid and the heights at its corners."""

    p: int = LANES  # cell along p
    t: int = LANES  # cell along t
    col: int = LANES  # cell along x, also beyond the map
    row: int = LANES  # cell along y, also beyond the map
    h00: int = LANES  # height at (col, row); NaN where data is missing
    h01: int = LANES  # height at (col + 1, row)
    h10: int = LANES  # height at (col, row + 1)
    h11: int = LANES  # height at (col + 1, row + 1)


class PieceRows(NamedTuple):
    """Piece of a rim over one cell.

    Gap = f0 - gs sin φ - gc cos φ - twist (ac sin² φ + e sin φ cos φ + bd cos² φ), with ac, e, bd of the rim.
    """

    sl: int = LANES  # sin φ of the left end
    cl: int = LANES  # cos φ of the left end
    sr: int = LANES  # sin φ of the right end
    cr: int = LANES  # cos φ of the right end
    late: int = LANES  # flag: the left end is on a grid line of constant t
    early: int = LANES  # flag: the right end is on a grid line of constant t
    f0: int = LANES
    gs: int = LANES
    gc: int = LANES
    twist: int = LANES  # mixed difference of the corner heights
    slope_p: int = LANES  # slope along p at the middle of the rim, m per cell
    slope_t: int = LANES  # slope along t there
    gap: int = LANES  # gap at the refined point; infinite where the point does not count
    sine: int = LANES  # sin φ of the refined point
    cosine: int = LANES  # cos φ of the refined point
    before: int = LANES  # flag: the refined point is the left end
    after: int = LANES  # flag: the refined point is the right end


class LowestRows(NamedTuple):
    """Lowest gap of one wheel found so far."""

    gap: int = LANES  # infinite: none yet; NaN over missing data
    sine: int = LANES  # sin φ
    cosine: int = LANES  # cos φ
    offset: int = LANES  # position along the axle
    col: int = LANES  # cell
    row: int = LANES
    gx: int = LANES  # slope of the contact along x
    gy: int = LANES  # slope of the contact along y
    doubt: int = LANES  # lower bound of the gap over what could not be searched; infinite: all was; NONE: not bounded


class HomeRows(NamedTuple):
    """Cell under the body, on the map: read in place of a cell whose index is NaN."""

    col: int = LANES
    row: int = LANES


class RimPieceRows(NamedTuple):
    """All pieces of a rim, two for each column of cells."""

    bound: int = 2 * COLUMNS * LANES  # lower bound of the gap; infinite: none, or searched
    cell: int = 2 * COLUMNS * LANES  # t of its cell


class TreadRows(NamedTuple):
    """Tread of one wheel in its own coordinates (u, v).

    Both are horizontal, from the hub: u across the axle, v along it. P is the parabola p0 + puu u² + v tan that touches the
    tread where the contact was, B the one that touches its lowest line.
    """

    zh: int = LANES  # height of the hub
    cos: int = LANES  # cos of the wheel's tilt: WHEEL.uz
    tan: int = LANES  # tan of the tilt
    over: int = LANES  # 1 / cos
    az: int = LANES  # z of the axle's direction
    u0: int = LANES  # u of the map's first node
    v0: int = LANES  # v of the map's first node
    u_x: int = LANES  # change of u from node to node along x
    u_y: int = LANES  # change of u from node to node along y
    v_x: int = LANES  # change of v from node to node along x
    v_y: int = LANES  # change of v from node to node along y
    over_x: int = LANES  # 1 / u_x, kept finite
    over_y: int = LANES  # 1 / u_y, kept finite
    aside_x: int = LANES  # 1 / v_x, kept finite
    aside_y: int = LANES  # 1 / v_y, kept finite
    v_low: int = LANES  # lowest v of the lower side
    v_high: int = LANES  # highest v of the lower side
    p_0: int = LANES  # height of P at u = v = 0
    p_uu: int = LANES  # coefficient of u² in P, 1/m
    p_x: int = LANES  # 1 / (2 × curvature coefficient of P along an edge in x)
    p_y: int = LANES  # the same along y
    b_0: int = LANES  # height of B at u = v = 0
    b_uu: int = LANES  # coefficient of u² in B, 1/m
    b_x: int = LANES  # 1 / (2 × curvature coefficient of B along an edge in x)
    b_y: int = LANES  # the same along y
    col_0: int = LANES  # first grid node under the wheel along x
    row_0: int = LANES  # first grid node under the wheel along y
    col_1: int = LANES  # last grid node under the wheel along x
    row_1: int = LANES  # last grid node under the wheel along y
    det: int = LANES  # area of a cell, m²
    half: int = LANES  # half the width; −1: no contact is sought
    max_slope_squared: int = LANES  # square of the steepest slope of the map, or of the part under the wheel
    clear: int = LANES  # flag: on terrain no steeper than that, only the lower side can touch
    fits: int = LANES  # flag: NODES has room for all nodes under the wheel
    rise_x: int = LANES  # greatest difference of neighbouring heights along x; NaN if data is missing
    rise_y: int = LANES  # greatest difference of neighbouring heights along y
    clear_all: int = LANES  # TREAD.clear by the steepest slope of the map
    node_col: int = LANES  # node that is copied to NODES
    node_row: int = LANES
    node_height: int = LANES  # its height


class LowLineRows(NamedTuple):
    """Line over a cell on which tread minus terrain is lowest along the axle.

    It is v = w0 + w1 u, from the cell's low corner.
    """

    w0: int = LANES  # m
    w1: int = LANES
    k1: int = LANES  # along the line the derivative by u is m / cos + k1 + k2 u, with m = u / q
    k2: int = LANES  # 1/m
    left: int = LANES  # its least u over the cell and under the tread
    right: int = LANES  # its greatest u there
    m_left: int = LANES  # m at the left end
    m_right: int = LANES  # m at the right end
    open: int = LANES  # flag: the derivative may rise through 0 between the ends


class NodeRows(NamedTuple):
    """Grid nodes under one wheel, row by row."""

    height: int = ROOM * LANES  # NaN where data is missing
    bound: int = ROOM * LANES  # lower bound of the gap over the edges to the right and above, then over the cell between


class BilinearRows(NamedTuple):
    """Contacts and state of a pose on bilinear terrain."""

    col: int = ALL  # cell of the contact
    row: int = ALL
    rejected: int = ALL  # flag: the search could not decide
    deepest: int = LANES  # largest |gap| of the six; NaN if one is NaN or infinite
    fate: int = LANES  # SEARCHING, SETTLED, FAILED or BEYOND


class SpotRows(NamedTuple):
    """Point of a tread, and the terrain under it."""

    x: int = LANES
    y: int = LANES
    z: int = LANES  # height of the tread
    h: int = LANES  # height of the terrain; NaN where data is missing


POSE, _end = place_rows(PoseRows, LINE)
WHEEL, _end = place_rows(WheelRows, _end)
CONTACT, _common = place_rows(ContactRows, _end)

CUBIC, CUBIC_SIZE = place_rows(CubicRows, _common)

BOUND, _end = place_rows(BoundRows, _common)
RIM, _end = place_rows(RimRows, _end)
COLUMN, _end = place_rows(ColumnRows, _end)
CELL, _end = place_rows(CellRows, _end)
PIECE, _end = place_rows(PieceRows, _end)
LOWEST, _end = place_rows(LowestRows, _end)
HOME, _end = place_rows(HomeRows, _end)
RIM_PIECES, _end = place_rows(RimPieceRows, _end)
TREAD, _end = place_rows(TreadRows, _end)
LOW_LINE, _end = place_rows(LowLineRows, _end)
NODES, _end = place_rows(NodeRows, _end)
BILINEAR, _end = place_rows(BilinearRows, _end)
SPOT, BILINEAR_SIZE = place_rows(SpotRows, _end)
#: Memory of two bilinear lane arrays, in one piece: glibc keeps freed memory up to twice the size of the largest piece. Of two
#: pieces, it may return the pages to the system after each call; the next call then takes 20 page faults.
TWO_BLOCKS = 2 * BILINEAR_SIZE + LINE


@inlined
def in_use(lanes: Array) -> int:
    """Return the number of lanes in use, HALF or LANES.

    The compiler derives from these two constants that rows do not overlap, and that vectors leave no remainder.

    Args:
        lanes: the lane array.

    Reads:  none
    Writes: none
    """
    return HALF if lanes[WIDTH] == HALF else LANES
