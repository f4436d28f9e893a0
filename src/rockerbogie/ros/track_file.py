"""File of the track: state of the odometry filter between two runs of the node."""

from __future__ import annotations

import json
import uuid
from pathlib import Path

from ..errors import RockerbogieError
from ..files.outputs import SOURCE, check_outputs
from ..logs.odometry_filter import OdometryFilter
from ..rover.model import Rover

#: End of the message for a file of another program: the node has no --force.
REMEDY = "set state_file to another name, or move that file away"


def load_track(rover: Rover, file: str) -> OdometryFilter | None:
    """Return the filter that a file holds.

    Args:
        rover: the rover of the track.
        file: path; '' for none.

    Returns:
        The filter, or `None` if the file does not exist.

    Raises:
        RockerbogieError: a file that cannot be read or written, or that holds another rover's track.
    """
    if not file:
        return None
    try:
        check_outputs([file], remedy=REMEDY)  # now, not only when the track is saved
        if not Path(file).exists():
            return None
        state = json.loads(Path(file).read_text(encoding="utf-8"))
        return OdometryFilter.from_state(rover, state["filter"])
    except (OSError, ValueError, KeyError, TypeError, RockerbogieError) as error:
        reason = f"it holds no {error}" if isinstance(error, KeyError) else f"{error}"
        raise RockerbogieError(f"state_file {file!r} cannot be used: {reason}") from None


def save_track(odometer: OdometryFilter, file: str) -> None:
    """Write a filter's state.

    The file is replaced in one step. A file that this package did not write is not replaced.

    Args:
        odometer: the filter.
        file: path.

    Raises:
        RockerbogieError: the file cannot be written.
    """
    try:
        check_outputs([file], remedy=REMEDY)
        part = Path(f"{file}.{uuid.uuid4().hex}.part")
        part.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_text(json.dumps({"source": SOURCE, "filter": odometer.state()}), encoding="utf-8")
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)
    except (OSError, RockerbogieError) as error:
        raise RockerbogieError(f"the track was not saved: {error}") from None
