"""Print the errors of the paper's contact angles (eqs 14-16), and their effect on the pose."""

import numpy as np

import rockerbogie as rb
from rockerbogie.bench.paper.baseline import fsolve_settle, paper_contact_angles

rover = rb.load_rover("elhami-dashti")
rng = np.random.default_rng(0)
n = 300
grounds = {
    "paper's terrain": (rb.surfaces.paper(), 0.02 * np.arange(201), 0.0, 0.0),
    "rough, slopes to 25 deg": (
        rb.surfaces.rough(0, min_radius=1.0, size=10.0),
        *rng.uniform(-4, 4, (2, n)),
        rng.uniform(-3, 3, n),
    ),
}


def paper_error(pose: rb.Pose) -> np.ndarray:
    """Return eqs 14-16 minus the exact angle (n, 6), deg, both at the exact pose and contact."""
    point, heading = pose.contact_point, pose.yaw[..., None] + pose.steering
    slope = pose.terrain.gradient(point[..., 0], point[..., 1])
    uphill = slope[..., 0] * np.cos(heading) + slope[..., 1] * np.sin(heading)
    return np.degrees(paper_contact_angles(rover, pose, uphill) - pose.contact_angle)


def spread(values: np.ndarray) -> str:
    """Return RMS and largest magnitude as two cells of a table."""
    return f"{np.sqrt((values**2).mean()):.3f} | {np.abs(values).max():.2f}"


print("| terrain | largest roll, deg | steered, deg | wheels | RMS, deg | worst, deg |\n" + "|---" * 6 + "|")
for name, (terrain, x, y, yaw) in grounds.items():
    for steered in (0, 10, 20):
        pose = rb.settle(rover, terrain, x, y, yaw, steering=np.radians([steered, steered, 0, 0, 0, 0]))
        error, roll = paper_error(pose), np.degrees(np.abs(pose.roll).max())
        wheels = ("rear", error[:, :2]) if steered else ("all", error)
        print(f"| {name} | {roll:.1f} | {steered} | {wheels[0]} | {spread(wheels[1])} |")

print("\n| terrain | stations | number | z, mm | roll, deg | pitch, deg | rocker, deg | bogies, deg |\n" + "|---" * 8 + "|")
for name, (terrain, x, y, yaw) in grounds.items():
    exact, paper = rb.settle(rover, terrain, x, y, yaw), fsolve_settle(rover, terrain, x, y, yaw)
    off = np.abs(paper.q - exact.q) * ([1e3] + [np.degrees(1.0)] * 5)
    sunk = paper.gap.min(axis=-1) < -1e-5  # a wheel penetrates the terrain beside its one contact
    for label, which in (("one contact", ~sunk), ("a wheel penetrates", sunk)):
        if which.any():
            worst = [*off[which, :4].max(axis=0), off[which, 4:].max()]
            print(f"| {name} | {label} | {which.sum()} of {which.size} | " + " | ".join(f"{w:.2g}" for w in worst) + " |")
