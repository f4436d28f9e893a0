"""Whole terrains: where a rover can go, and the way there."""
