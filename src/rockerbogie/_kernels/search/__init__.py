"""Search for the global minimum of the gap between one tread, or the body, and the ground."""
