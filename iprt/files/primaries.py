"""Conversion of colors between RGB with different primaries and white points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Chromaticity = tuple[float, float]
Primaries = Sequence[Chromaticity]
"""Chromaticities x, y of red, green, blue and white."""

D65 = (0.3127, 0.3290)
REC709: Primaries = ((0.640, 0.330), (0.300, 0.600), (0.150, 0.060), D65)
MAX_CONDITION = 1e3
"""Largest condition number of the matrix of chromaticities; Rec.709 has 3, wider primaries less."""
SAME = 1e-3
"""Differences of chromaticities below which they count as equal, as files round them."""
_D65_XYZ = np.array([D65[0] / D65[1], 1.0, (1.0 - sum(D65)) / D65[1]])
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
"""XYZ to the cone responses of Bradford's chromatic adaptation (ICC.1:2022, annex E)."""


def to_rec709(primaries: Primaries) -> NDArray[np.float32] | None:
    """Return the (3, 3) matrix from linear RGB of `primaries` to Rec.709; None if they are equal.

    White maps to white.

    Raises
    ------
    ValueError
        The chromaticities span no colors, or their white is invalid.
    """
    if np.allclose(primaries, REC709, rtol=0.0, atol=SAME):
        return None
    return (np.linalg.inv(_to_xyz(REC709)) @ _to_xyz(primaries)).astype(np.float32)


def _to_xyz(primaries: Primaries) -> NDArray[np.float64]:
    """Return (3, 3) from linear RGB to XYZ under D65 (SMPTE RP 177; white points by Bradford)."""
    xyz = np.array([[x, y, 1.0 - x - y] for x, y in primaries], np.float64)
    columns, white = xyz[:3].T, xyz[3]
    # Collinear primaries span no colors, and nearly collinear ones amplify noise.
    if not (np.isfinite(xyz).all() and white[1] > 0.0 and np.linalg.cond(columns) < MAX_CONDITION):
        raise ValueError("chromaticities that span no colors")
    white = white / white[1]
    matrix = columns * np.linalg.solve(columns, white)
    cones = _BRADFORD @ white
    if not (cones > 0.0).all():
        raise ValueError("a white point that is no color")
    gains = (_BRADFORD @ _D65_XYZ) / cones
    return np.asarray(np.linalg.inv(_BRADFORD) @ np.diag(gains) @ _BRADFORD @ matrix)
