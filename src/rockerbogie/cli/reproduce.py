def reproduce() -> int:
    """TODO"""
    return 0
