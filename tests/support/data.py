"""Folder of the shared data files: real terrain, telemetry and trials, which the project does not contain."""

from __future__ import annotations

import os
from pathlib import Path

DATA = Path(os.environ.get("ROCKERBOGIE_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
