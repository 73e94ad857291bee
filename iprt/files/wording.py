"""Wording of quantities in messages."""


def counted(number: int, noun: str) -> str:
    """Format a count with its noun: `1 frame`, `2 frames`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def length(metres: float) -> str:
    """Format a length as `2.20 m`, `3.4 cm` or `1.2 km`."""
    if metres >= 1000.0:
        return f"{metres / 1000.0:.3g} km"
    return f"{metres:.2f} m" if metres >= 0.995 else f"{100.0 * metres:.1f} cm"


def extent(size: tuple[int, int]) -> str:
    """Return a width and height as text."""
    return f"{size[0]} x {size[1]}"
