"""Motion of a rover predicted from the forces on its wheels."""
