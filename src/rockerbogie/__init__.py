"""rockerbogie."""
from .rover import Rover, Link
from .terrain import Terrain
from .frames import wheel_frames
