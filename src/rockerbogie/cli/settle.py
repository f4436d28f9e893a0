def settle() -> int:
    """TODO"""
    return 0
