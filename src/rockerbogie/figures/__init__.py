"""Pictures of poses, runs, maps and rovers."""

from . import plot as plot
