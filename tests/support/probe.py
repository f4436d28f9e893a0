"""A small rover as text in URDF, SDF and MJCF, for tests that change a few words of it.

Mass 35.8 kg: body 20, rockers 2, bogies 1.5, forks 0.4, wheels 1.2; wheel radius 0.11 m, width 0.09 m.
"""

from __future__ import annotations

from collections.abc import Iterator

QUARTER = "1.5707963267948966"
WHEEL = f'<collision><origin rpy="{QUARTER} 0 0"/><geometry><cylinder radius="0.11" length="0.09"/></geometry></collision>'
BODY = '<collision><geometry><box size="0.6 0.36 0.2"/></geometry></collision>'
#: Rows: link, mass, parent, joint, kind, x, y, z relative to the parent (left side), limit (rad).
Row = tuple[str, float, str, str, str, float, float, float, float]


def rows() -> Iterator[Row]:
    """Yield the links and joints of both sides, parents first."""
    for s, k in (("l", 1.0), ("r", -1.0)):
        rocker, bogie = f"rocker_{s}_link", f"bogie_{s}_link"
        yield rocker, 2.0, "base", f"rocker_{s}", "pitch", 0.08, 0.2 * k, 0.0, 0.5
        yield bogie, 1.5, rocker, f"bogie_{s}", "pitch", -0.29, 0.05 * k, -0.12, 0.6
        yield f"fork_F{s}", 0.4, rocker, f"steer_F{s}", "steer", 0.34, 0.11 * k, -0.3, 0.8
        yield f"tyre_F{s}", 1.2, f"fork_F{s}", f"drive_F{s}", "wheel", 0.0, 0.0, 0.0, 0.0
        yield f"tyre_M{s}", 1.2, bogie, f"drive_M{s}", "wheel", 0.19, 0.09 * k, -0.18, 0.0
        yield f"fork_R{s}", 0.4, bogie, f"steer_R{s}", "steer", -0.19, 0.06 * k, -0.18, 0.8
        yield f"tyre_R{s}", 1.2, f"fork_R{s}", f"drive_R{s}", "wheel", 0.0, 0.0, 0.0, 0.0


def urdf_link(name: str, mass: float, shapes: str = "") -> str:
    """Return a URDF link; without <inertial> if it has no mass."""
    inertial = (
        f'<inertial><mass value="{mass}"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
        if mass
        else ""
    )
    return f'<link name="{name}">{inertial}{shapes}</link>'


def urdf(body: str = BODY, wheel: str = WHEEL, extra: str = "") -> str:
    """Return the rover as URDF."""
    lines = [urdf_link("base", 20, body)]
    for link, mass, parent, joint, kind, x, y, z, limit in rows():
        axis = "0 0 1" if kind == "steer" else "0 1 0"
        ends = f'<limit lower="-{limit}" upper="{limit}" effort="9" velocity="1"/>' if limit else ""
        mimic = '<mimic joint="rocker_l" multiplier="-1"/>' if joint == "rocker_r" else ""
        lines.append(urdf_link(link, mass, wheel if kind == "wheel" else ""))
        turns = "revolute" if limit else "continuous"
        lines.append(
            f'<joint name="{joint}" type="{turns}"><parent link="{parent}"/><child link="{link}"/>'
            f'<origin xyz="{x:g} {y:g} {z:g}"/><axis xyz="{axis}"/>{ends}{mimic}</joint>'
        )
    return '<robot name="probe">\n' + "\n".join(lines) + extra + "\n</robot>"


def sdf(version: str = "1.9", wheel_roll: float = 0.0, wheel_axis: str = "") -> str:
    """Return the rover as SDF, poses in the model's frame.

    `wheel_roll`, rad, rotates the wheels' link frames.
    """
    inertia = "<inertia><ixx>0.02</ixx><iyy>0.02</iyy><izz>0.02</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>"
    roll = float(QUARTER) - wheel_roll
    tyre = (
        f'<collision name="c"><pose>0 0 0 {roll!r} 0 0</pose><geometry><cylinder><radius>0.11</radius><length>0.09</length>'
        "</cylinder></geometry></collision>"
    )
    box = '<collision name="c"><geometry><box><size>0.6 0.36 0.2</size></box></geometry></collision>'
    lines = [f'<link name="base"><pose>0 0 0 0 0 0</pose><inertial><mass>20</mass>{inertia}</inertial>{box}</link>']
    at = {"base": (0.0, 0.0, 0.0)}
    for link, mass, parent, joint, kind, x, y, z, limit in rows():
        at[link] = tuple(round(a + b, 9) for a, b in zip(at[parent], (x, y, z), strict=True))  # type: ignore[assignment]
        pose = " ".join(f"{v:g}" for v in at[link])
        turn = f"{wheel_roll!r} 0 0" if kind == "wheel" and wheel_roll else "0 0 0"
        ends = f"<limit><lower>-{limit}</lower><upper>{limit}</upper></limit>" if limit else wheel_axis if kind == "wheel" else ""
        axis = "0 0 1" if kind == "steer" else "0 1 0"
        lines.append(
            f'<link name="{link}"><pose>{pose} {turn}</pose><inertial><mass>{mass}</mass>{inertia}</inertial>'
            f"{tyre if kind == 'wheel' else ''}</link>"
        )
        lines.append(
            f'<joint name="{joint}" type="revolute"><parent>{parent}</parent><child>{link}</child>'
            f"<axis><xyz>{axis}</xyz>{ends}</axis></joint>"
        )
    return f'<?xml version="1.0"?><sdf version="{version}"><model name="probe">\n' + "\n".join(lines) + "\n</model></sdf>"


def mjcf(body: str = '<geom type="box" size="0.3 0.18 0.1" mass="20"/>', asset: str = "", equality: str = "") -> str:
    """Return the rover as MJCF."""
    table = list(rows())

    def nested(parent: str) -> str:
        text = ""
        for link, mass, above, joint, kind, x, y, z, limit in table:
            if above != parent:
                continue
            axis = "0 0 1" if kind == "steer" else "0 1 0"
            ends = f' range="-{limit} {limit}" limited="true"' if limit and kind == "pitch" else ""
            if kind == "wheel":
                geom = f'<geom type="cylinder" size="0.11 0.045" euler="{QUARTER} 0 0" mass="{mass}"/>'
            else:
                shape = 'type="capsule" fromto="0 0 0 0 0 -0.05" size="0.02" contype="0" conaffinity="0"'
                geom = f'<geom {shape} mass="{mass}"/>'
            text += (
                f'<body name="{link}" pos="{x:g} {y:g} {z:g}"><joint name="{joint}" type="hinge" axis="{axis}"{ends}/>'
                f"{geom}{nested(link)}</body>"
            )
        return text

    return (
        f'<mujoco model="probe"><compiler angle="radian"/><asset>{asset}</asset><worldbody><body name="base" pos="0 0 1">'
        f"<freejoint/>{body}{nested('base')}</body></worldbody>"
        f'<equality><joint joint1="rocker_r" joint2="rocker_l" polycoef="0 -1 0 0 0"/>{equality}</equality></mujoco>'
    )
