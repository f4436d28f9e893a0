"""Print poses in equilibrium on difficult terrain; `docs/draw_gallery.py` draws them."""

import numpy as np

import rockerbogie as rb


def ground(size: float, cell: float, *obstacles) -> rb.Terrain:
    """Return level terrain, `size` m across, with obstacles: functions from x, y to heights."""
    axis = np.linspace(-size / 2, size / 2, round(size / cell) + 1)
    x, y = np.meshgrid(axis, axis)
    z = np.max([np.zeros_like(x), *(obstacle(x, y) for obstacle in obstacles)], axis=0)
    return rb.Terrain.from_array(z, cell, (axis[0], axis[0]), "linear")


def rock(x0, y0, a, b, height):
    """Return the upper half of an ellipsoid."""
    return lambda x, y: height * np.sqrt(np.maximum(1 - ((x - x0) / a) ** 2 - ((y - y0) / b) ** 2, 0))


def step(height):
    """Return a step at x = 0."""
    return lambda x, y: np.where(x > -1e-9, height, 0.0)


def plateau(x0, y0, height):
    """Return a plateau that ends at x > x0 and y > y0."""
    return lambda x, y: np.where((x > x0 - 1e-9) & (y > y0 - 1e-9), 0.0, height)


def equilibrium(rover: str, terrain: rb.Terrain, x: float = 0.0, y: float = 0.0, yaw_deg: float = 0.0) -> rb.Pose:
    """Return the equilibrium of a preset."""
    return rb.settle(rb.load_rover(rover), terrain, x, y, np.radians(yaw_deg), mode="equilibrium")


def bridging(rover: str, terrain: rb.Terrain, wheel: int, behind: float, ahead: float) -> rb.Pose:
    """Find, by bisection of x, the pose in which a wheel is in contact with two rocks at once."""
    for _ in range(40):
        middle = (behind + ahead) / 2
        on_the_next = equilibrium(rover, terrain, middle).contact_angle[wheel] < 0
        behind, ahead = (behind, middle) if on_the_next else (middle, ahead)
    return equilibrium(rover, terrain, behind)


def poses() -> dict[str, tuple[str, rb.Pose]]:
    """Return title and pose by name of the picture."""
    pebbles = ground(1.6, 0.005, rock(0.35, 0.24, 0.035, 0.06, 0.03), rock(0.465, 0.235, 0.04, 0.05, 0.04))
    return {
        "step": ("Up a step of 0.3 m, higher than the axle", equilibrium("curiosity", ground(7, 0.02, step(0.3)), -1.05, 0, 15)),
        "astride": (
            "Astride a rock",
            equilibrium("perseverance", ground(7, 0.02, rock(0.05, 0, 0.6, 1.35, 0.6)), -0.15, 0.1, 12),
        ),
        "limit": ("A bogie at its limit", equilibrium("osr", ground(1.6, 0.005, rock(0.32, 0.2, 0.08, 0.09, 0.2)))),
        "edge": ("One wheel beyond an edge", equilibrium("curiosity", ground(7, 0.02, plateau(0.44, 0.3, 1.5)))),
        "body": ("The body on a rock", equilibrium("perseverance", ground(7, 0.02, rock(0.2, 0.05, 0.5, 0.6, 0.7)), 0, 0, 6)),
        "bridge": ("One wheel on two rocks", bridging("rocky7", pebbles, 0, -0.04, 0.04)),
    }


def degrees(angle: float) -> str:
    """Return an angle (rad) in degrees as text."""
    return f"{np.degrees(angle):.2f}°".replace("-0.00", "0.00")


def tables(pose: rb.Pose) -> str:
    """Return the numbers of a pose in Markdown."""
    rover, lifted, ends = pose.rover, pose.wheel_lifted, pose.joint_stop
    weight = rover.mass * 9.80665
    notes = [
        f"{joint} at its {'low' if end < 0 else 'high'} limit"
        for joint, end in zip(("rocker", "left bogie", "right bogie"), ends, strict=True)
        if end
    ]
    notes += [f"{name} off the ground" for name, up in zip(rover.wheel_names, lifted, strict=True) if up]
    notes += [f"{pose.belly_support / weight:.1%} of the weight on the body"] if pose.belly_support > 0 else []
    forced = rb.settle(rover, pose.terrain, pose.x, pose.y, pose.yaw)
    with_bogies = "" if np.isnan(forced.z) else ", bogies at " + " and ".join(map(degrees, forced.bogie))

    def row(*cells: str) -> str:
        return "| " + " | ".join(cells) + " |"

    return "\n".join([
        f"**{rb.Status(int(pose.status)).name}**" + (": " if notes else "") + ", ".join(notes)
        + f". (Contact mode: {rb.Status(int(forced.status)).name}{with_bogies}.)", "",
        row("roll", "pitch", "rocker", "left bogie", "right bogie", "body above terrain"), "|---" * 6 + "|",
        row(*map(degrees, (pose.roll, pose.pitch, pose.rocker, *pose.bogie)), f"{1e3 * max(pose.clearance, 0):.0f} mm"), "",
        row("wheel", *rover.wheel_names), "|---" * 7 + "|",
        row("contact angle", *("–" if up else degrees(angle) for angle, up in zip(pose.contact_angle, lifted, strict=True))),
        row("gap, mm", *("0" if abs(gap) < 1e-6 else f"{1e3 * gap:.1f}" for gap in pose.gap)),
        row("contacts", *map(str, pose.contact_count)),
        row("share of the weight", *(f"{force / weight:.1%}" for force in pose.support)),
    ])  # fmt: skip


if __name__ == "__main__":
    for title, pose in poses().values():
        print(f"### {title}\n\n{tables(pose)}\n")
