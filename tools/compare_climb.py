"""Compare `rb.climb` with MuJoCo: random rovers, steps and friction, wheels at one rate.

    python tools/compare_climb.py --cases 200 --seed 0

A case counts if its verdict is the same for a step 5 % lower and higher and for 5 % less and more friction. Wheels are discs,
joints have no limits, and the motors' torque is large: friction decides. A rover whose bogie turns by more than a right angle has
capsized and has not climbed.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import rockerbogie as rb
from rockerbogie.simulation.height_field import terrain_contact
from rockerbogie.simulation.mjcf import build_spec
from rockerbogie.simulation.motors import GRAVITY
from rockerbogie.simulation.rigid_body import Rig

ROVERS = ("curiosity", "osr", "rocky7", "sawppy", "elhami-dashti")
FREE = (-np.inf, np.inf)
#: Speed of the rims in units of the wheel's radius, 1/s, and time step, s.
RATE, STEP = 0.25, 0.002
#: The rover has stopped if its rear hubs move less than this share of the rims' travel over this many radii of it.
STOPPED, WATCHED = 0.02, 6.0
#: Step heights in wheel radii and friction coefficients of the cases.
HEIGHTS, FRICTIONS = (0.2, 1.6), (0.3, 1.0)


@dataclass(frozen=True)
class Case:
    """One rover, direction, step height (m) and friction coefficient."""

    rover: rb.Rover
    direction: str
    height: float
    friction: float


def free_rover(name: str) -> rb.Rover:
    """Return a preset without joint limits, its wheels discs."""
    return rb.load_rover(name).replace(bogie_limits=FREE, rocker_limits=FREE, wheel_width=0.0, masses="keep")


def predict(case: Case, height: float = 1.0, friction: float = 1.0, law: str = "equal_slip") -> rb.Climb:
    """Return the climb with height and friction multiplied."""
    step = rb.obstacles.step(case.height * height)
    return rb.climb(case.rover, step, friction=case.friction * friction, direction=case.direction, law=law)  # type: ignore[arg-type]


def clear(case: Case) -> bool:
    """Return True if the verdict is the same 5 % around the case, and friction decides."""
    around = [predict(case, *by) for by in ((1, 1), (0.95, 1), (1.05, 1), (1, 0.95), (1, 1.05))]
    return len({run.climbed for run in around}) == 1 and all(run.limit in ("", "friction", "tip_over") for run in around)


def simulate(case: Case) -> tuple[bool, str]:
    """Drive the rover at the step in MuJoCo.

    Returns:
        True if all wheels get onto the step, and the place of the first axle that does not: front, middle or rear.
    """
    import mujoco

    rover, r = case.rover, float(case.rover.wheel_radius.max())
    spec = build_spec(rover, friction=case.friction, torque=5.0 * rover.mass * GRAVITY * r)
    spec.option.timestep = STEP
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 1], **terrain_contact())
    forward = 1.0 if case.direction == "forward" else -1.0
    front = float((forward * rover.hubs[:, 0]).max() + r)
    face = front + 0.3 * r
    place = [forward * (face + 10.0), 0.0, case.height - 1.0]
    box = mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(name="step", type=box, size=[10.0, 10.0, 1.0], pos=place, **terrain_contact())
    rig = Rig(rover, spec.compile())
    plane = rb.surfaces.plane(size=8.0 * front, spacing=front / 4.0)
    rig.place(rb.settle(rover, plane, 0.0, 0.0, 0.0), 1e-4)
    rig.command(np.zeros(6), np.zeros(6))
    rig.step(0.5)
    order = np.argsort(-forward * rover.hubs[::2, 0])
    rear, period = 2 * int(order[-1]), 0.1
    rates = forward * RATE * r / rover.wheel_radius
    history: list[float] = []
    window = round(WATCHED / RATE / period)
    while len(history) < 40 * window:
        rig.command(rates, np.zeros(6))
        rig.step(period)
        if rig.upright <= 0 or np.abs(rig.record().hinge[2:]).max() > np.pi / 2:
            break
        history.append(float(forward * rig.hubs[rear, 0]))
        if history[-1] > face + 0.3 * r:
            return True, ""
        if len(history) > window and history[-1] - history[-1 - window] < STOPPED * WATCHED * r:
            break
    past = [bool(forward * rig.hubs[2 * axle, 0] > face) for axle in order]
    return False, ("front", "middle", "rear")[past.index(False)] if False in past else "rear"


def draw(rng: np.random.Generator) -> Case:
    """Return a random case."""
    rover = free_rover(str(rng.choice(ROVERS)))
    height = rng.uniform(*HEIGHTS) * float(rover.wheel_radius.max())
    return Case(rover, str(rng.choice(["forward", "backward"])), float(height), float(rng.uniform(*FRICTIONS)))


def main() -> None:
    """Run the comparison and print the agreement."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="JSON file for all cases")
    options = parser.parse_args()
    rng, rows = np.random.default_rng(options.seed), []
    while len(rows) < options.cases:
        case = draw(rng)
        if not clear(case):
            continue
        run, bound = predict(case), predict(case, law="least_friction")
        climbed, place = simulate(case)
        row: dict[str, Any] = {
            "rover": case.rover.name, "direction": case.direction, "height": case.height / case.rover.wheel_radius.max(),
            "friction": case.friction, "predicted": run.climbed, "least_friction": bound.climbed, "simulated": climbed,
            "limit": run.limit, "phase": run.phase, "stopped": place, "needed": run.friction_needed,
        }  # fmt: skip
        rows.append(row)
        mark = "" if run.climbed == climbed else "   DIFFERS"
        print(" ".join(f"{v:.3f}" if isinstance(v, float) else str(v) for v in row.values()) + mark, flush=True)
    agree = [row for row in rows if row["predicted"] == row["simulated"]]
    failed = [row for row in agree if not row["predicted"]]
    phase = sum(row["stopped"] in row["phase"] for row in failed)
    bound_agree = sum(row["least_friction"] == row["simulated"] for row in rows)
    print(
        f"climb or no climb: {len(agree)} of {len(rows)} agree (least_friction: {bound_agree}); "
        f"{sum(row['simulated'] for row in rows)} climbed; failing axle: {phase} of {len(failed)} agree"
    )
    if options.output is not None:
        options.output.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
