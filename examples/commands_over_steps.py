"""Compare wheel rates of `drive` with six equal rates over steps, in MuJoCo."""

import sys

import numpy as np

import rockerbogie as rb

SPEED, SPACING = 0.05, 0.01
rover = rb.load_rover("elhami-dashti")  # wheels of 10 cm radius
path = rb.Path.straight((-0.6, 0.0), 0.0, 4.6)


def course(height: float) -> rb.Terrain:
    """Return terrain with five steps of `height` m: left, right, both sides, left, right."""
    x, y = np.arange(-1.5, 5.5, SPACING), np.arange(-0.8, 0.8, SPACING)
    z = np.zeros((len(y), len(x)))
    for start, end, rows in ((0.3, 0.8, y > 0), (1.1, 1.6, y < 0), (1.9, 2.6, y < 9), (3.0, 3.4, y > 0), (3.2, 3.7, y < 0)):
        z[np.ix_(rows, (x > start) & (x < end))] = height
    return rb.Terrain.from_array(z, SPACING, (x[0], y[0]), "linear", name=f"steps of {100 * height:g} cm")


def slipped(run) -> np.ndarray:
    """Return the distance (n,) that all six treads have slipped along their headings, m."""
    step = np.diff(run["time"].values, prepend=0.0)[:, None]
    return np.nancumsum(np.nansum(np.abs(run["roll_slip"].values) * step, axis=1))


runs = {}
print("| steps | rates of `drive`, load sharing | without load sharing | six equal rates |\n|---|---|---|---|")
for height in (0.03, 0.05, 0.08):
    terrain = course(height)
    plan = rb.drive(rover, terrain, path, SPEED)
    equal = plan.copy(deep=True)
    equal["wheel_rate"][:] = SPEED / rover.wheel_radius
    trimmed = rb.simulate(rover, terrain, path, SPEED)  # each wheel at the rate of `drive` at the rover's position
    alone = rb.simulate(rover, terrain, path, SPEED, load_sharing=False)
    same = rb.simulate(rover, terrain, path, commands=equal)
    runs[height] = trimmed, same
    cells = [f"{slipped(run)[-1]:.2f} m, {float(run['x'][-1] + 0.6):.2f} m far" for run in (trimmed, alone, same)]
    print(f"| {100 * height:g} cm | {' | '.join(cells)} |", flush=True)

if len(sys.argv) > 1:  # a picture
    from rockerbogie.figures.style import LEFT, RIGHT, figure, look

    with look():
        fig = figure(8.0, 3.2)
        ax = fig.subplots()
        for (height, pair), style in zip(runs.items(), (":", "--", "-"), strict=True):
            for run, colour, name in zip(pair, (LEFT, RIGHT), ("rates of drive", "equal rates"), strict=True):
                ax.plot(run["x"], slipped(run), color=colour, ls=style, label=f"{100 * height:g} cm, {name}")
        ax.set(xlabel="x (m)", ylabel="slipped so far, six wheels (m)", title="Slip over steps, wheels of 10 cm radius")
        ax.legend(fontsize=8)
    fig.savefig(sys.argv[1])
