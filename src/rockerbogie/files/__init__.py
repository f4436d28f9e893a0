"""Output guards, CSV tables, vector files, and the version that files record."""
