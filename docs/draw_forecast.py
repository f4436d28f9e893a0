"""Draw docs/img/forecast_*.png and print the numbers of docs/forecast.md.

python docs/draw_forecast.py FOLDER_OF_DATA
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import rockerbogie as rb
from rockerbogie.figures.slip import slip_figure
from rockerbogie.figures.style import save

OUT = Path(__file__).parent / "img"
LOGS = ("sol01590_first60.csv", "sol01294_first60.csv", "slip_steps/sol01286_slip.csv", "slip_steps/sol01295_slip.csv")


def main(folder: Path) -> None:
    """Forecast along all logs, print scores and fits, and draw the pictures of both drives."""
    rover = rb.load_rover("perseverance")
    scores = []
    for name in LOGS:
        log = rb.read_slip_log(folder / "perseverance" / name, rover)
        forecast = rb.forecast_slip(rover, None, log)
        score = rb.score_forecast(forecast, log)
        print(name, {key: score.attrs[key] for key in ("warnings", "false_warnings", "passes_limit", "lead")})
        for target in score["target"].values:
            one = score.sel(target=target)
            print(
                f"   {target}: {int(one['count'])}, RMSE", dict(zip(score["by"].values, one["rmse"].values.round(4), strict=True))
            )
            print(f"      in band {float(one['coverage']):.2f}")
        print("   warned at", forecast["distance"].values[forecast["warning"].values].round(1).tolist())
        if "first60" not in name:
            continue
        scores.append(score)
        fit = rb.fit_soil(rover, None, log)
        sigma = np.sqrt(np.diag(fit.curve.gain_covariance))
        print(
            f"   level {fit.curve.level:.2f} ± {fit.curve.level_sigma:.2f}, along {fit.curve.gain_along:.1f} ± {sigma[0]:.1f}",
            end=", ",
        )
        print(f"across {fit.curve.gain_across:.1f} ± {sigma[1]:.1f}, change {fit.change:g} per m, error {fit.curve.error:g}")
        print(
            "   15°, 20° uphill:",
            [fit.slip(np.sin(np.radians(d)), last=end).round(2).tolist() for d in (15, 20) for end in (False, True)],
        )
        save(slip_figure(log, forecast, fit), OUT / f"forecast_{name[:8]}.png")
    for target in scores[0]["target"].values:
        counts = np.array([int(s["count"].sel(target=target)) for s in scores])
        squares = np.array([s["rmse"].sel(target=target).values ** 2 for s in scores])
        together = np.sqrt(counts @ squares / counts.sum())
        print(f"both drives, {target}: RMSE {together.round(4)}, forecast / others {(together[0] / together[1:]).round(2)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
