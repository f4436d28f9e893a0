"""Results of the paper: its own solver as a baseline, its figures, and a report that checks its claims."""
