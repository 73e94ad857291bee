"""What is read off the pixels of the desktop viewer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.desktop.style import TEXT, Color
from tests.viewer.screen.user import User


def widget(user: User, label: str) -> NDArray[np.uint8]:
    """The pixels of a widget on the screen."""
    left, top = user.app.window.position
    low_x, low_y, high_x, high_y = (round(value) for value in user.places[label])
    return user.screen.picture(left + low_x, top + low_y, high_x - low_x, high_y - low_y)


def texts(pixels: NDArray[np.uint8], color: Color = TEXT) -> int:
    """Pixels in the color of text."""
    return int((np.abs(pixels - 255.0 * np.array(color[:3])).max(axis=2) < 24.0).sum())
