"""Entry point for all picture formats: chosen by suffix, checked before rendering."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import require_writable

SUFFIXES = (".exr", ".png")


def check_output(path: Path, *, aovs: Sequence[str] = ()) -> None:
    """Raise an error now if a picture with the layers `aovs` could not be written to `path` later.

    Raises
    ------
    FormatError
        Unknown suffix, layers in a format without them, or no permission to write.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FormatError(
            f"{path}: unknown output format '{path.suffix}'; supported: {', '.join(SUFFIXES)}, and "
            "for video .mp4, .mov, .mkv"
        )
    if aovs and suffix != ".exr":
        raise FormatError(f"{path}: a {suffix} file holds no layers; write an .exr for --aov")
    require_writable(path)


def write_picture(
    path: Path,
    color: NDArray[np.float32],
    *,
    aovs: Mapping[str, NDArray[Any]] | None = None,
    exposure: float = 1.0,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write linear radiance (H, W, 3) in the format of the suffix of `path`, atomically.

    Parameters
    ----------
    aovs : mapping of name to array, optional
        Layers of an EXR file, see `write_exr`.
    exposure : float
        Used by display-referred formats only; EXR keeps scene-linear radiance.

    Raises
    ------
    FormatError
        As in `check_output` and the format's writer.
    """
    from iprt.output.exr import write_exr
    from iprt.output.png import write_png

    check_output(path, aovs=tuple(aovs or ()))
    if path.suffix.lower() == ".exr":
        write_exr(path, color, aovs=aovs, metadata=metadata)
    else:
        write_png(path, color, exposure=exposure, metadata=metadata)
