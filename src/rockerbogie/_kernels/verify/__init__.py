"""Independent verification of gaps. It shares no code with the search."""
