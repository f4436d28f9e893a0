"""Loops over batches of poses, called from Python."""
