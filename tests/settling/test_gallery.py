"""The gallery in docs/settling.md equals the output of its example, with its pictures."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples"))
import gallery  # noqa: E402

POSES = gallery.poses()


@pytest.mark.parametrize("name", POSES)
def test_page_shows_the_pose(name: str) -> None:
    title, pose = POSES[name]
    page = (ROOT / "docs" / "settling.md").read_text(encoding="utf-8")
    section = page.split(f"### {title}\n", 1)[1].split("\n#", 1)[0]
    assert gallery.tables(pose) in section
    assert f"(img/gallery_{name}.png)" in section
    assert (ROOT / "docs" / "img" / f"gallery_{name}.png").stat().st_size < 150_000


def test_each_pose_shows_its_subject() -> None:
    pose = {name: pose for name, (_, pose) in POSES.items()}
    assert -1.0 < pose["step"].contact_angle[0] < -0.7  # on the edge of a step higher than its axle
    assert pose["astride"].clearance < 0.15
    assert pose["limit"].joint_stop.tolist() == [0, -1, 0]
    assert pose["edge"].wheel_lifted.tolist() == [True, False, False, False, False, False]
    assert pose["body"].belly_support > 0.5 * pose["body"].rover.mass * 9.80665
    assert pose["bridge"].contact_count.tolist() == [2, 1, 1, 1, 1, 1]
