"""Names of a log's columns and joints, matched to the package's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..errors import RockerbogieError, unknown_name
from ..rover.model import Rover
from .channels import SIDES, LogReport, column_names

#: Parts of topic names that mark commands, not measurements.
COMMANDS = ("command", "cmd", "desired", "target", "setpoint", "reference", "goal")


@dataclass(frozen=True)
class Match:
    """A column of the log that holds one of ours."""

    topic: str  # "" in files without topics
    column: str
    sign: float


def joint_roles(rover: Rover) -> dict[str, tuple[str, str]]:
    """Return the names that a joint may have.

    Args:
        rover: the rover; its wheels' names are parts of joint names.

    Returns:
        Name in lower case -> (our column for its position, our column for its rate, "" if it is not used).
    """
    roles: dict[str, tuple[str, str]] = {}
    for wheel in rover.wheel_names:
        pair = (f"wheel_angle_{wheel}", f"wheel_rate_{wheel}")
        roles |= {f"wheel_{wheel}": pair, f"wheel_angle_{wheel}": pair, f"wheel_rate_{wheel}": (pair[1], pair[1])}
        roles |= {f"steer_{wheel}": (f"steering_{wheel}", ""), f"steering_{wheel}": (f"steering_{wheel}", "")}
    roles |= {"rocker_left": ("rocker", ""), "rocker": ("rocker", "")}
    roles |= {f"bogie_{side}": (f"bogie_{side}", "") for side in SIDES}
    roles |= {f"{name}_joint": pair for name, pair in roles.items()}
    return {name.lower(): pair for name, pair in roles.items()}


def match_columns(
    available: Mapping[str, Sequence[str]],
    rover: Rover,
    names: Mapping[str, str],
    file: str,
    report: LogReport,
) -> dict[str, Match]:
    """Match the columns of a log to ours.

    Args:
        available: topic -> its columns; one topic "" for files without topics. `joint.rate` is a joint's velocity.
        rover: the rover that made the log.
        names: the log's name -> ours, a minus before ours for the opposite sign. Ours is a column (`steering_LF`) or a
            joint of `to_urdf` (`steer_LF_joint`).
        file: the log's name, for messages.
        report: gets a note for topics that are left out.

    Returns:
        Our column -> its topic and column in the log.

    Raises:
        RockerbogieError: a name that the log does not have, that is none of ours, or that is given twice; two topics or
            columns that could both be meant.
    """
    found, used = _named(available, rover, names, file)
    candidates: dict[str, list[Match]] = {}
    ours, joints = {name.lower(): name for name in column_names(rover)}, joint_roles(rover)
    for topic, columns in available.items():
        for column in columns:
            if (topic, column) in used:
                continue
            base = column.removesuffix(".rate")
            tail = base.replace("::", "/").rpartition("/")[2].lower()
            role = joints[tail][column.endswith(".rate")] if topic and tail in joints else ""
            if not role and not column.endswith(".rate"):
                role = ours.get(tail, "")
            if role and role not in found:
                candidates.setdefault(role, []).append(Match(topic, column, 1.0))
    return found | {role: _choose(role, matches, file, report) for role, matches in candidates.items()}


def _named(
    available: Mapping[str, Sequence[str]], rover: Rover, names: Mapping[str, str], file: str
) -> tuple[dict[str, Match], set[tuple[str, str]]]:
    """Return the matches that the user gives, and the (topic, column) pairs they use."""
    found: dict[str, Match] = {}
    used: set[tuple[str, str]] = set()
    ours, joints = column_names(rover), joint_roles(rover)
    for theirs, given in names.items():
        sign, target = (-1.0, given[1:].strip()) if given.startswith("-") else (1.0, given)
        is_joint = target not in ours and target.lower() in joints
        if target not in ours and target != "time" and not is_joint:
            raise RockerbogieError(f"names: {theirs!r} is given as {unknown_name('column', target, (*ours, 'time'))}")
        places = [(topic, c) for topic, columns in available.items() for c in (theirs, f"{theirs}_joint") if c in columns]
        places = _best_topics(places)
        if not places:
            listed = sorted({c for columns in available.values() for c in columns})
            raise RockerbogieError(f"{file} has no column {theirs!r}; it has {', '.join(listed)}")
        if len(places) > 1 and places[0][0] != places[1][0]:
            raise RockerbogieError(
                f"{theirs!r} is in topics {' and '.join(t for t, _ in places)} of {file}: name one with --topic"
            )
        topic, column = places[0]
        pair = joints[target.lower()] if is_joint or (topic and target.lower() in joints) else (target, "")
        rate = f"{column}.rate"
        wanted = [(pair[0], column)]
        if topic and pair[0] == pair[1] and rate in available[topic]:
            wanted = [(pair[0], rate)]
        elif topic and pair[1] and rate in available[topic] and rate not in names and not column.endswith(".rate"):
            wanted.append((pair[1], rate))
        if column.endswith(".rate"):
            wanted = [(pair[1] or pair[0], column)]
        for role, source in wanted:
            if role in found:
                raise RockerbogieError(f"names: both {found[role].column!r} and {source!r} are given as {role}")
            found[role] = Match(topic, source, sign)
            used.add((topic, source))
    return found, used


def _choose(role: str, matches: list[Match], file: str, report: LogReport) -> Match:
    """Return the match in the most likely topic."""
    exact = [m for m in matches if m.column == role] if len({m.topic for m in matches}) == 1 else []
    if len(exact) == 1:
        return exact[0]
    topics = dict.fromkeys(m.topic for m in matches)
    best = dict.fromkeys(topic for topic, _ in _best_topics([(topic, "") for topic in topics]))
    if len(best) > 1:
        raise RockerbogieError(
            f"{file} has {role} in topics {' and '.join(best)}: name the one to read with --topic (topics=[…] in Python)"
        )
    for topic in topics:
        if topic not in best:
            report.note(f"topic {topic} holds {role.rpartition('_')[0] or role} too and was not read")
    left = [m for m in matches if m.topic in best]
    if len(left) > 1:
        raise RockerbogieError(
            f"{file} has {role} in columns {' and '.join(m.column for m in left)}: say which with --name COLUMN={role}"
        )
    return left[0]


def _best_topics(places: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the places in topics of measurements, preferably called joint_states."""
    measured = [p for p in places if not any(word in p[0].lower() for word in COMMANDS)] or places
    called = [p for p in measured if p[0].rpartition("/")[2] == "joint_states"]
    return called if len({t for t, _ in called}) == 1 else measured


def flipped(rover: Rover, flips: Sequence[str]) -> set[str]:
    """Return the columns whose sign is turned.

    Args:
        rover: the rover.
        flips: columns, or parts of their names: `steering`, `wheel_RF`, `wheel`, `bogie_left`, `yaw`.

    Returns:
        Our columns.

    Raises:
        RockerbogieError: a name that is none of ours.
    """
    ours = column_names(rover)
    groups = {
        variable: [c for c, (v, _) in ours.items() if v == variable] for variable in dict.fromkeys(v for v, _ in ours.values())
    }
    groups |= {column: [column] for column in ours}
    groups |= {f"wheel_{w}": [f"wheel_angle_{w}", f"wheel_rate_{w}"] for w in rover.wheel_names}
    groups["wheel"] = groups["wheel_angle"] + groups["wheel_rate"]
    turned: set[str] = set()
    for name in flips:
        if name not in groups:
            raise RockerbogieError(f"flip: {unknown_name('column', name, groups)}")
        turned ^= set(groups[name])
    return turned
