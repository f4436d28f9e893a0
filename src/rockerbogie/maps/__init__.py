"""Traversability maps of whole terrains, and routes over them."""
