def drive() -> int:
    """TODO"""
    return 0


def simulate() -> int:
    """TODO"""
    return 0
