"""Frames of the fades between chunks, kept until both chunks have rendered them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.output.picture import HALF_MAX
from iprt.renderer import RenderedFrame

Side = Literal["tail", "lead"]
"""The chunk that ends in a fade, or the one that begins in it."""


class Seams:
    """Store of the pictures of fades, one file for each side of each frame.

    Parameters
    ----------
    folder : Path
    half : bool
        Store 16-bit floats, which suffice for display-referred formats.
    """

    def __init__(self, folder: Path, *, half: bool) -> None:
        self._folder, self._half = folder, half

    def has(self, side: Side, index: int) -> bool:
        """Return whether one side of a frame is there."""
        return self._file(side, index).exists()

    def keep(
        self, side: Side, index: int, picture: RenderedFrame, metadata: Mapping[str, str]
    ) -> None:
        """Store one side of a frame.

        Raises
        ------
        FormatError
            It cannot be written.
        """
        layers = {"color": picture.color, **{f"aov {k}": v for k, v in picture.aovs.items()}}
        stored = {name: self._stored(layer) for name, layer in layers.items()}
        stored["metadata"] = np.array(json.dumps(dict(metadata)))
        with replacing(self._file(side, index)) as temporary, temporary.open("wb") as file:
            np.savez(file, allow_pickle=False, **stored)

    def blended(self, index: int, share: float) -> tuple[RenderedFrame, dict[str, str]] | None:
        """Blend both sides of a frame; return it and its metadata, or None if a side is missing.

        Parameters
        ----------
        share : float
            Weight of the chunk that begins.

        Raises
        ------
        FormatError
            A side is damaged.
        """
        if not (self.has("tail", index) and self.has("lead", index)):
            return None
        tail, lead = self._load("tail", index), self._load("lead", index)
        if tail is None or lead is None:  # another process has blended it meanwhile
            return None
        metadata = json.loads(str(tail.pop("metadata")))
        layers = {name: _mean(tail[name], lead[name], share) for name in tail}
        color = layers.pop("color")
        return RenderedFrame(
            color, {k.removeprefix("aov "): v for k, v in layers.items()}
        ), metadata

    def drop(self, index: int) -> None:
        """Remove both sides of a frame."""
        for side in ("tail", "lead"):
            self._file(side, index).unlink(missing_ok=True)

    def _file(self, side: str, index: int) -> Path:
        return self._folder / f"{index:07d}.{side}.npz"

    def _stored(self, layer: NDArray[np.float32]) -> NDArray[Any]:
        return np.clip(layer, -HALF_MAX, HALF_MAX).astype(np.float16) if self._half else layer

    def _load(self, side: Side, index: int) -> dict[str, NDArray[Any]] | None:
        path = self._file(side, index)
        try:
            with np.load(path, allow_pickle=False) as stored:
                return dict(stored)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, EOFError, BadZipFile) as error:
            raise FormatError(
                f"{path}: is damaged; delete it and run the same command again"
            ) from error


def _mean(tail: NDArray[Any], lead: NDArray[Any], share: float) -> NDArray[np.float32]:
    """Return the weighted mean, exact where both are equal or infinite."""
    first, second = tail.astype(np.float32), lead.astype(np.float32)
    with np.errstate(invalid="ignore"):
        mean = first + np.float32(share) * (second - first)
    return np.where(first == second, first, mean)
