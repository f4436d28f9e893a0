"""Draw docs/img/conventions.svg: frames and signs, computed by the package.

python docs/draw_conventions.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon

import rockerbogie as rb
from rockerbogie.figures.style import INK, LEFT, RIGHT
from rockerbogie.rover.rotations import rotation_y

OUT = Path(__file__).parent / "img" / "conventions.svg"
FAINT, FRAME, GROUND = "#c9c9c9", "#009E73", "#8a6d3b"
ROVER = rb.load_rover("elhami-dashti")
R = ROVER.wheel_radius[0]
WINDOW = {
    "pitch": (-0.35, 0.45),
    "roll": (-0.35, 0.45),
    "yaw": (-0.35, 0.45),
    "wheels": (-0.45, 0.45),
}  # vertical, m
SIDE, TOP, REAR = (0, 2), (0, 1), (1, 2)  # body axes that point right and up on the page


def arrow(ax: Axes, start: np.ndarray, end: np.ndarray, colour: str, text: str = "", gap: float = 1.18) -> None:
    """Draw an arrow with a label beyond its tip."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    ax.annotate(
        "", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}, zorder=6
    )
    if text:
        ax.text(*(start + gap * (end - start)), text, color=colour, ha="center", va="center", zorder=6)


def turn(ax: Axes, centre: np.ndarray, radius: float, start: float, sweep: float, colour: str, text: str) -> None:
    """Draw a curved arrow from angle `start` through `sweep`, deg, counter-clockwise positive."""
    first, last = sorted((start, start + sweep))
    ax.add_patch(Arc(tuple(centre), 2 * radius, 2 * radius, theta1=first, theta2=last, color=colour, lw=1.6, zorder=6))
    at = np.radians(start + sweep)
    tip = np.asarray(centre) + radius * np.array([np.cos(at), np.sin(at)])
    way = np.sign(sweep) * np.array([-np.sin(at), np.cos(at)])
    ax.annotate("", tip + 0.012 * way, tip - 0.012 * way, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.6}, zorder=6)
    mid = np.radians(start + sweep / 2)
    ax.text(
        *(centre + (radius + 0.075) * np.array([np.cos(mid), np.sin(mid)])),
        text,
        color=colour,
        ha="center",
        va="center",
        zorder=7,
    )


def linkage(ax: Axes, rho: float, beta: float, colour: str) -> tuple[np.ndarray, np.ndarray]:
    """Draw the left rocker and bogie; return the bogie pivot and the hubs (3, 2) on the page."""
    hubs = rb.wheel_frames(ROVER, rho, [beta, 0.0])[::2, :3, 3][:, SIDE]
    pivot = ROVER.rocker_pivot[0]
    bogie = (pivot + rotation_y(rho) @ (ROVER.bogie_pivot[0] - pivot))[list(SIDE)]
    for a, b in ((hubs[0], pivot[list(SIDE)]), (pivot[list(SIDE)], bogie), (bogie, hubs[1]), (bogie, hubs[2])):
        ax.plot(*np.transpose([a, b]), color=colour, lw=3, solid_capstyle="round", zorder=3)
    for hub in hubs:
        ax.add_patch(Circle(tuple(hub), R, fill=False, ec=colour, lw=2, zorder=3))
    for joint in (bogie, pivot[list(SIDE)]):
        ax.add_patch(Circle(tuple(joint), 0.014, fc="white", ec=colour, lw=1.6, zorder=5))
    return bogie, hubs


def body(ax: Axes, axes: tuple[int, int], T: np.ndarray, colour: str) -> None:
    """Draw the body's box, transformed by T (4, 4), in the plane of two axes."""
    low, high = ROVER.body_box
    c, r = (low + high) / 2, (high - low) / 2
    corners = np.zeros((4, 3))
    corners[:, axes[0]], corners[:, axes[1]] = r[axes[0]] * np.array([-1, 1, 1, -1]), r[axes[1]] * np.array([-1, -1, 1, 1])
    seen = (T[:3, :3] @ (corners + np.where(np.isin(range(3), axes), c, 0)).T).T[:, axes]
    ax.add_patch(Polygon(seen, closed=True, fill=False, ec=colour, lw=2))


def frame_view(ax: Axes, axes: tuple[int, int], angles: tuple[float, float, float], names: tuple[str, str]) -> None:
    """Draw the body at (roll, pitch, yaw) with its axes, and its reference attitude in grey."""
    body(ax, axes, np.eye(4), FAINT)
    T = rb.body_transform(0, 0, 0, *angles)
    body(ax, axes, T, INK)
    for axis, name in zip(axes, names, strict=True):
        arrow(ax, np.zeros(2), 0.34 * T[list(axes), axis], FRAME, name)


def rest(ax: Axes) -> str:
    bogie, hubs = linkage(ax, 0.0, 0.0, INK)
    arrow(ax, np.zeros(2), [0.3, 0], FRAME, "$x_R$")
    arrow(ax, np.zeros(2), [0, 0.2], FRAME, "$z_R$", gap=1.2)
    ax.plot([-0.45, 0.68], [hubs[0, 1] - R] * 2, color=GROUND, lw=1.5)
    ax.text(-0.04, 0.03, "R, D", ha="right", color=FRAME)
    ax.text(bogie[0] + 0.03, bogie[1] + 0.03, "$B_1$", color=INK)
    for i, hub in enumerate(hubs):
        ax.text(hub[0], hub[1] - R - 0.06, f"$A_{2 * i + 1}$  {ROVER.wheel_names[2 * i]}", ha="center", va="center", color=INK)
    return "1  The left side with joints at 0\nx forward, z up, y into the page: to the left of the rover"


def joints(ax: Axes) -> str:
    linkage(ax, 0.0, 0.0, FAINT)
    bogie, _ = linkage(ax, np.radians(14), np.radians(16), LEFT)
    turn(ax, np.zeros(2), 0.19, 25, -50, RIGHT, r"$\rho$")
    turn(ax, bogie, 0.15, 50, -60, RIGHT, r"$\beta_1$")
    return "2  Rocker and bogie: nose down is positive\nthe right rocker turns by $-\\rho$; $\\beta$: bogie relative to rocker"


def contact(ax: Axes) -> str:
    slope = np.radians(25)
    normal, along = np.array([-np.sin(slope), np.cos(slope)]), np.array([np.cos(slope), np.sin(slope)])
    hub, size = np.array([0.05, -0.12]), 0.32
    point = hub - size * normal
    ax.plot(*np.transpose([point - 0.55 * along, point + 0.5 * along]), color=GROUND, lw=2)
    ax.add_patch(Circle(tuple(hub), size, fill=False, ec=INK, lw=2))
    arrow(ax, hub, hub + [0.21, 0], FRAME, "$x_A$", gap=1.2)
    arrow(ax, hub, hub + [0, 0.2], FRAME, "$z_A$", gap=1.2)
    ax.plot(*np.transpose([hub, hub - [0, size]]), color=INK, lw=1, ls=":")
    ax.plot(*np.transpose([hub, point]), color=INK, lw=1, ls=":")
    turn(ax, hub, 0.22, -90, 25, RIGHT, "")
    ax.text(hub[0] - 0.02, hub[1] - 0.16, r"$\delta<0$", color=RIGHT, ha="right")
    arrow(ax, point, point + 0.22 * along, LEFT, "")
    arrow(ax, point, point + 0.16 * normal, LEFT, "")
    ax.text(*(point + 0.2 * along + [0.02, -0.06]), "$x_C$", color=LEFT)
    ax.text(*(point + 0.12 * normal + [0.03, 0.0]), "$z_C$", color=LEFT)
    ax.add_patch(Circle(tuple(point), 0.014, fc=LEFT, ec=LEFT, zorder=7))
    return "3  Contact angle (eq. 5)\nuphill the contact is ahead of the axle: $\\delta$ is negative"


def pitch(ax: Axes) -> str:
    frame_view(ax, SIDE, (0, np.radians(20), 0), ("$x$", "$z$"))
    turn(ax, np.zeros(2), 0.42, 4, -20, RIGHT, r"$\Phi_y$")
    return "4  Pitch: nose down is positive\nseen from the right side"


def roll(ax: Axes) -> str:
    frame_view(ax, REAR, (np.radians(20), 0, 0), ("$y$", "$z$"))
    turn(ax, np.zeros(2), 0.42, -4, 20, RIGHT, r"$\Phi_x$")
    ax.invert_xaxis()
    return "5  Roll: left side up is positive\nseen from behind"


def yaw(ax: Axes) -> str:
    frame_view(ax, TOP, (0, 0, np.radians(25)), ("$x$", "$y$"))
    turn(ax, np.zeros(2), 0.42, 1, 20, RIGHT, r"$\Phi_z$")
    return "6  Yaw: to the left is positive\nseen from above; R = Rz(yaw) Ry(pitch) Rx(roll), eq. 10"


def wheels(ax: Axes) -> str:
    body(ax, TOP, np.eye(4), FAINT)
    psi = np.radians([20, 20, 0, 0, 0, 0])
    frames = rb.wheel_frames(ROVER, 0.0, [0.0, 0.0], psi)
    for i, T in enumerate(frames):
        half, hub = R * T[:2, 0], T[:2, 3]
        ax.plot(*np.transpose([hub - half, hub + half]), color=LEFT if i % 2 == 0 else RIGHT, lw=7, solid_capstyle="butt")
        ax.text(hub[0], hub[1] + np.sign(hub[1]) * 0.1, f"{i}  {ROVER.wheel_names[i]}", ha="center", va="center")
    hub = frames[0, :2, 3]
    ax.plot(*np.transpose([hub, hub + [0.24, 0]]), color=INK, lw=1, ls=":")
    turn(ax, hub, 0.17, 0, 20, INK, r"$\psi$")
    arrow(ax, np.zeros(2), [0.26, 0], FRAME, "$x$")
    arrow(ax, np.zeros(2), [0, 0.14], FRAME, "$y$", gap=1.25)
    return "7  Wheels; steering to the left is positive\nthe rocker's wheel first: the rear one on this rover"


def slip(ax: Axes) -> str:
    point, hub = np.array([0.1, -0.45]), np.array([0.1, -0.17])
    ax.plot([-0.42, 0.65], [point[1]] * 2, color=GROUND, lw=2)
    ax.add_patch(Circle(tuple(hub), 0.28, fill=False, ec=INK, lw=2))
    ax.add_patch(Circle(tuple(point), 0.014, fc=LEFT, ec=LEFT, zorder=7))
    arrow(ax, point, point + [0.36, 0], LEFT, "")
    arrow(ax, point, point + [0, 0.2], LEFT, "")
    ax.text(point[0] + 0.32, point[1] + 0.03, r"$x_C\quad r\dot\theta+\dot\xi$", color=LEFT)
    ax.text(point[0] + 0.03, point[1] + 0.15, r"$z_C\quad\dot\zeta$", color=LEFT)
    ax.text(point[0] - 0.03, point[1] + 0.05, r"$y_C\quad\dot\eta$", color=LEFT, ha="right")
    turn(ax, hub, 0.33, 125, -70, RIGHT, r"$\dot\theta$")
    return "8  Rolling and slip at the contact (eq. 6)\nrolling slip $\\xi$, side slip $\\eta$, turn slip $\\zeta$"


def grid(ax: Axes) -> str:
    dx, dy, corner = 0.2, 0.14, np.array([-0.2, -0.4])
    for row in range(4):
        for col in range(5):
            chosen = (row, col) == (2, 3)
            ax.plot(*(corner + [col * dx, row * dy]), "o", color=RIGHT if chosen else FAINT, ms=7 if chosen else 5)
    ax.text(*(corner + [3 * dx, 2 * dy + 0.05]), "z[2, 3]", color=RIGHT, ha="center")
    ax.text(*(corner + [0.03, -0.02]), "z[0, 0] at (x0, y0)", va="top")
    arrow(ax, corner + [-0.07, 0], corner + [-0.07, 0.46], FRAME)
    ax.text(*(corner + [-0.1, 0.5]), "row, $y$, north", color=FRAME)
    arrow(ax, corner + [0, -0.12], corner + [0.8, -0.12], FRAME)
    ax.text(*(corner + [0.8, -0.15]), "column, $x$, east", color=FRAME, ha="right", va="top")
    return "9  Height arrays: y grows with the row\nz[row, col] is the height at (x0 + col dx, y0 + row dy)"


def main() -> None:
    """Write docs/img/conventions.svg."""
    mpl.rcParams |= {"svg.hashsalt": "rockerbogie", "font.size": 9.5, "mathtext.fontset": "dejavusans"}
    fig = Figure(figsize=(13, 11.6))
    views = (rest, joints, contact, pitch, roll, yaw, wheels, slip, grid)
    for i, view in enumerate(views):
        row, col = divmod(i, 3)
        ax = fig.add_axes((0.015 + col / 3, 0.68 - row / 3, 0.31, 0.26))
        ax.set(xlim=(-0.5, 0.75), ylim=WINDOW.get(view.__name__, (-0.62, 0.25)), aspect="equal", anchor="NW")
        ax.set_axis_off()
        title, note = view(ax).split("\n")
        fig.text(0.015 + col / 3, 0.975 - row / 3, title, weight="bold", size=11)
        fig.text(0.015 + col / 3, 0.957 - row / 3, note, color="#555555")
    OUT.parent.mkdir(exist_ok=True)
    fig.savefig(OUT, metadata={"Date": None})


if __name__ == "__main__":
    main()
