"""Wheel-soil forces: soils, laws, tables, fits to wheel trials (docs/soil.md)."""
