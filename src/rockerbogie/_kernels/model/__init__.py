"""Models of ground, wheel and linkage at one pose."""
