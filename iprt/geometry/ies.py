"""Photometric files of luminaires: IES LM-63, type C.

Source: ANSI/IES LM-63-02, "Standard File Format for the Electronic Transfer of Photometric Data".
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.message_text import printable
from iprt.files.safe_reading import read_bytes
from iprt.geometry.light import PROFILE_SHAPE

MAX_IES_BYTES = 2**22
_HEAD = 13
"""Numbers before the angles."""
_TYPE_C = 1
Float = NDArray[np.float64]


@dataclass(frozen=True)
class Luminaire:
    """Light of a luminaire by direction.

    Attributes
    ----------
    profile : PROFILE_SHAPE float32
        As in `Light.profile`, with 1 where it is brightest. The file's nadir is the light's axis,
        and its horizontal angle of 0 the light's +X.
    candela : float
        The largest luminous intensity.
    """

    profile: NDArray[np.float32]
    candela: float


def read_ies(path: Path) -> Luminaire:
    """Read a photometric file.

    Directions without values are dark.

    Raises
    ------
    FormatError
        The file is missing, damaged, too large, of another type than C, or dark.
    """
    text = read_bytes(path, MAX_IES_BYTES).decode("latin-1")
    _, found, rest = text.partition("TILT=")
    if not found:
        raise FormatError(f"{path}: no line TILT=; expected an IES photometric file (LM-63)")
    tilt, _, rest = rest.partition("\n")
    numbers = _numbers(path, rest)
    if tilt.strip() == "INCLUDE":
        # Its factors are for lamps that hang at an angle, which no luminaire is made for.
        count = int(_at(path, numbers, 1))
        numbers = numbers[2 + 2 * max(count, 0) :]
    elif tilt.strip() != "NONE":
        raise FormatError(
            f"{path}: TILT={printable(tilt.strip())} names another file; write TILT=NONE"
        )
    return _luminaire(path, numbers)


def _luminaire(path: Path, numbers: Float) -> Luminaire:
    _at(path, numbers, _HEAD - 1)
    factor = float(numbers[2] * numbers[10] * numbers[11])
    rows, columns, kind = (int(value) for value in numbers[3:6])
    if kind != _TYPE_C:
        raise FormatError(f"{path}: photometry of type {kind}; only type C (1) is read")
    if not (1 <= rows <= len(numbers) and 1 <= columns <= len(numbers)):
        raise FormatError(f"{path}: {rows} vertical and {columns} horizontal angles")
    _at(path, numbers, _HEAD + rows + columns + rows * columns - 1)
    polar, turn, values = np.split(numbers[_HEAD:], [rows, rows + columns])
    values = values[: rows * columns].reshape(columns, rows)
    if (np.diff(polar) <= 0.0).any() or (np.diff(turn) <= 0.0).any():
        raise FormatError(f"{path}: its angles do not increase")
    table = np.maximum(_around(path, turn, values) * factor, 0.0)
    angles = np.linspace(0.0, 180.0, PROFILE_SHAPE[0])
    profile = np.stack([np.interp(angles, polar, row, 0.0, 0.0) for row in table], axis=1)
    largest = float(profile.max())
    if not 0.0 < largest < np.inf:
        raise FormatError(f"{path}: its largest intensity is {largest:g} cd")
    return Luminaire((profile / largest).astype(np.float32), largest)


def _around(path: Path, turn: Float, values: Float) -> Float:
    """Return (columns, rows) values all around, of a file that may hold a half or a quarter."""
    wanted = np.linspace(0.0, 360.0, PROFILE_SHAPE[1])
    last = turn[-1]
    if len(turn) == 1:
        return np.repeat(values, len(wanted), axis=0)
    if turn[0] == 90.0 and last == 270.0:  # symmetric about the plane of 90 and 270 degrees
        at = np.where((wanted >= 90.0) & (wanted <= 270.0), wanted, (540.0 - wanted) % 360.0)
    elif turn[0] == 0.0 and last in (90.0, 180.0, 360.0):
        at = wanted
        if last <= 180.0:
            at = np.minimum(at, 360.0 - at)
        if last == 90.0:
            at = np.minimum(at, 180.0 - at)
    else:
        raise FormatError(
            f"{path}: horizontal angles from {turn[0]:g} to {last:g}; expected 0 to 90, 180 or "
            "360, or 90 to 270"
        )
    return np.stack([np.interp(at, turn, row) for row in values.T], axis=1)


def _numbers(path: Path, text: str) -> Float:
    try:
        return np.array(text.replace(",", " ").split(), np.float64)
    except ValueError as error:
        raise FormatError(f"{path}: {printable(str(error))}") from None


def _at(path: Path, numbers: Float, index: int) -> float:
    """Return a number, which must exist and, like the ones before, be finite."""
    if index >= len(numbers):
        raise FormatError(f"{path}: ends after {len(numbers)} numbers; it is damaged")
    if not np.isfinite(numbers[: index + 1]).all():
        raise FormatError(f"{path}: holds numbers that are not finite")
    return float(numbers[index])
