"""Folder of the shared data files (terrain, telemetry, trials), kept outside the project."""

from __future__ import annotations

import os
from pathlib import Path

DATA = Path(os.environ.get("ROCKERBOGIE_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
