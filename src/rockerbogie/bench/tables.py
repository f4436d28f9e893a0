"""Tables of the figures: headings and rows of text, for a terminal or a page."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Table:
    """Table of text: caption, headings, and rows of as many cells."""

    caption: str
    headings: list[str]
    rows: list[list[str]]

    def markdown(self) -> str:
        """Return the table as Markdown.

        Returns:
            The text.
        """
        lines = [self.headings, ["---", *["---:"] * (len(self.headings) - 1)], *self.rows]
        return "\n".join([self.caption, "", *(f"| {' | '.join(line)} |" for line in lines)])


def tables(figures: Mapping[str, Any], before: Mapping[str, float] | None = None) -> list[Table]:
    """Return all tables of the figures.

    Args:
        figures: the last yield of `bench.figures`.
        before: case → ratio to "rim", and name of a wait → its ratio, in another run, for one more column.

    Returns:
        Times, quality, ratios, errors, growth, waits, slowest poses, and other costs.
    """
    cases = figures["cases"]
    count = cases[0]["threads"]
    times: list[tuple[str, Callable[[Any], str]]] = [
        ("settled", lambda c: f"{c['settled']:.1%}"),
        ("µs", lambda c: _three(c["us"])),
        ("p50", lambda c: _three(c["us_p50"])),
        ("p99", lambda c: _three(c["us_p99"])),
        ("path", lambda c: _three(c["us_along"])),
        ("1000/s", lambda c: _three(c["poses_per_s"] / 1e3)),
        (f"{count} thr", lambda c: _three(c["poses_per_s_all_threads"] / 1e3)),
    ]
    quality: list[tuple[str, Callable[[Any], str]]] = [
        ("gap", lambda c: f"{c['worst_gap']:.0e}"),
        ("≤1e-9", lambda c: f"{c['within_1e_9']:.4%}"),
        ("≤1e-6", lambda c: f"{c['within_1e_6']:.4%}"),
        (f"{count} thr", lambda c: f"{c['speedup']:.2f}"),
    ]
    ratios: list[tuple[str, Callable[[Any], str]]] = [
        ("hub", lambda c: _ratio(c, "hub")),
        ("point", lambda c: _ratio(c, "point")),
        ("coarse", lambda c: _ratio(c, "coarse")),
        ("rim", lambda c: _ratio(c, "rim")),
        ("MuJoCo", lambda c: _ratio(c, "mujoco")),
    ]
    errors: list[tuple[str, Callable[[Any], str]]] = [
        ("hub", lambda c: _gap(c, "hub")),
        ("point", lambda c: _gap(c, "point")),
        ("coarse", lambda c: _gap(c, "coarse")),
        ("rim", lambda c: _gap(c, "rim")),
    ]
    if before:
        ratios.append(("before", lambda c: f"{before[c['name']]:,.0f}" if c["name"] in before else "-"))
    return [
        _of(cases, "µs per pose on one thread: mean, groups of 16, along a path; thousand poses/s", times),
        _of(cases, "worst gap of converged poses, m; share within 1e-9, 1e-6 m; threads over one", quality),
        _of(cases, "time of a baseline over ours (*: it fails at most poses)", ratios),
        _of(cases, "error of fsolve: worst of six gaps, m, median over its poses", errors),
        *_growth(figures["growth"]),
        *_waits(figures.get("waits", []), before or {}),
        *_worst(figures.get("worst", [])),
        Table("other costs", ["cost", "value"], _other_costs(figures)),
    ]


def _three(value: float) -> str:
    """Return a number with three digits."""
    return f"{value:,.{max(0, 2 - math.floor(math.log10(value)))}f}" if value > 0 else f"{value:.2g}"


def _ratio(case: Mapping[str, Any], baseline: str) -> str:
    """Return a ratio, with * if the baseline failed at most poses."""
    ratio, solved = case["ratios"][baseline], case["baseline_solved"][baseline]
    if not solved:
        return "fails"
    return f"{ratio:,.0f}" + ("*" if solved < 0.5 else "")


def _gap(case: Mapping[str, Any], baseline: str) -> str:
    """Return a baseline's median gap as text; a dash if it solved no pose."""
    gap = case["baseline_gap"][baseline]
    return "-" if gap is None else f"{gap:.0e}"


def _of(cases: list[Any], caption: str, columns: list[tuple[str, Callable[[Any], str]]]) -> Table:
    """Return a table of one row per case, with a text per column."""
    rows = [[case["name"], *(text(case) for _, text in columns)] for case in cases]
    return Table(caption, ["case", *(heading for heading, _ in columns)], rows)


def _growth(growth: Mapping[str, Any]) -> list[Table]:
    """Return tables of the time per pose against batch size, map size and cell size."""
    titles = {
        "poses": ("poses", "poses in one call, smooth cubic terrain"),
        "nodes": ("nodes", "nodes of the map, rough terrain, thin disc"),
        "cells": ("radius_over_cell", "wheel radius over cell size, rocks, whole tread"),
    }
    made = []
    for name, (key, caption) in titles.items():
        heads = [
            f"{row[key]:,.0f}" if row[key] >= 100 or row[key] == int(row[key]) else f"{row[key]:.1f}" for row in growth[name]
        ]
        made.append(Table(caption, ["", *heads], [["µs per pose", *(_three(row["us"]) for row in growth[name])]]))
    return made


def _waits(rows: list[Any], before: Mapping[str, float]) -> list[Table]:
    """Return the tables of what users wait for: jobs of this process, and new processes.

    Args:
        rows: as `waits.waits` returns them.
        before: name of a wait → its ratio in another run.
    """
    jobs, starts = ([row for row in rows if row["unit"] == unit] for unit in ("fsolve", "import"))
    made = [
        ("wait, per pose on one thread; ratio: fsolve on smooth terrain over ours", "µs", 1.0, jobs),
        ("new process, median; ratio: a process that imports numba over ours", "s", 1e-6, starts),
    ]
    more = ["before"] if before else []
    return [
        Table(
            caption,
            ["wait", unit, "ratio", *more],
            [
                [row["name"], _three(row["us"] * scale), _three(row["ratio"])]
                + [_three(before[row["name"]]) if row["name"] in before else "-" for _ in more]
                for row in chosen
            ],
        )
        for caption, unit, scale, chosen in made
        if chosen
    ]


def _worst(rows: list[Any]) -> list[Table]:
    """Return the table of the slowest poses, if they were timed.

    Args:
        rows: as `worst.worst` yields them.
    """
    heads = ["terrain", "rover", "p50", "p99", "slowest", "slowest/p50"]
    cells = [
        [row["terrain"], row["rover"], *(_three(row[f"us_{part}"]) for part in ("p50", "p99", "worst"))]
        + [f"{row['us_worst'] / row['us_p50']:.1f}"]
        for row in rows
    ]
    return [Table("µs of a single pose, each by a call of its own", heads, cells)] if rows else []


def _other_costs(figures: Mapping[str, Any]) -> list[list[str]]:
    """Return rows of text: what is measured, and its value with the unit."""
    calls, jacobians, memory = figures["calls"], figures["jacobians"], figures["memory"]
    rows = [
        ["one pose in one call from Python", f"{calls['single_us']:.1f} µs"],
        ["first pose of a new process, kernels already compiled", f"{calls['first_settle_s']:.2f} s"],
        ["memory of a million poses, and at most while settling", f"{memory['kept_mb']:.0f} MB, {memory['peak_mb']:.0f} MB"],
        [f"frames and Jacobians of six wheels, batches of {jacobians['poses']:,}", f"{jacobians['us']:.3f} µs per pose"],
        [f"the same, {jacobians['many']:,} at once, into existing memory", f"{jacobians['us_many']:.3f} µs per pose"],
        ["the same, Jacobians alone, into new memory", f"{jacobians['us_many_new_memory']:.3f} µs per pose"],
    ]
    if "pinocchio_us" in jacobians:
        bare, called = jacobians["pinocchio_us"], jacobians["pinocchio_from_python_us"]
        rows += [
            ["Pinocchio, without the cost of its calls", f"{bare:.2f} µs: × {jacobians['ratio']:.1f}"],
            ["Pinocchio, called from Python", f"{called:.2f} µs: × {called / jacobians['us']:.0f}"],
        ]
    return rows
