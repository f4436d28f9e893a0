"""Triangle meshes of rovers and terrain, and pages that show them offline; no matplotlib."""
