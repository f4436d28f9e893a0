"""Results of the paper: its solver as a baseline, its figures, and a report on its claims."""
