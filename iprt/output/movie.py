"""Video file written incrementally: finished frames survive any interruption of the render.

Encoders hold pictures back until they know the following ones, and files without their end are
unusable. So the folder of the film's parts holds pieces of a few seconds, encoded so that they can
be joined, and the pictures of incomplete pieces, exactly as the encoder will see them. When all are
complete, the pieces become the file.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import replacing, require_regular
from iprt.output.encode import encode_piece, join_pieces, planes, read_comment
from iprt.output.film_plan import FilmPlan
from iprt.output.frames import FrameOutput, Metadata
from iprt.output.metadata import difference
from iprt.output.parts import Parts
from iprt.output.spatial_media import equirect_boxes

if TYPE_CHECKING:
    from iprt.renderer import RenderedFrame

PIECE_S = 2.0
"""Seconds of video per piece, which is also the distance of points that players can seek to."""


class Movie(FrameOutput):
    """Frames as a video file.

    Attributes
    ----------
    finished : bool
        The file shows this film already.
    """

    def __init__(self, path: Path, plan: FilmPlan, parts: Parts) -> None:
        self.path = path
        self._plan, self._parts = plan, parts
        self._length = max(round(PIECE_S * plan.rate), 1)
        whole = {**plan.identity, "iprt:audio": "no" if plan.sound is None else "yes"}
        self._comment = json.dumps(whole, sort_keys=True)
        self.finished = _same(read_comment(path), whole)

    def has(self, index: int) -> bool:
        """Return whether a frame is in a piece, or waits for the others of its piece."""
        position = self._plan.frames.index(index)
        first = position - position % self._length
        # In this order: a picture disappears once its piece is there.
        return self.finished or self._picture(position).exists() or self._piece(first).exists()

    def write(self, index: int, picture: RenderedFrame, metadata: Metadata) -> None:
        """Keep a frame; encode a piece when its last frame arrives."""
        position = self._plan.frames.index(index)
        # NumPy itself does not notice when a disk is full at the end of a file.
        stored = BytesIO()
        np.save(stored, planes(picture.color, self._plan.exposure, self._plan.codec))
        with replacing(self._picture(position)) as temporary:
            temporary.write_bytes(stored.getbuffer())
        self._encode(position - position % self._length)

    def clean(self) -> None:
        """Do nothing: files are written into the folder of parts alone."""

    def finish(self) -> None:
        """Write the file from its pieces."""
        if self.finished:
            return
        for first in self._firsts():
            self._encode(first)
        pieces = [(first, self._piece(first)) for first in self._firsts()]
        joined = self._parts.path / f"joined{self.path.suffix}"
        join_pieces(
            joined,
            pieces,
            rate=self._plan.rate,
            comment=self._comment,
            additions=equirect_boxes() if self._plan.spherical else None,
            sound=self._plan.sound,
        )
        require_regular(self.path)
        try:
            with joined.open("rb") as file:
                os.fsync(file.fileno())
            joined.replace(self.path)
        except OSError as error:
            raise FormatError(f"{self.path}: cannot be written: {error.strerror}") from error
        self.finished = True

    def _firsts(self) -> range:
        """Return the first positions of pieces."""
        return range(0, len(self._plan.frames), self._length)

    def _positions(self, first: int) -> range:
        return range(first, min(first + self._length, len(self._plan.frames)))

    def _piece(self, first: int) -> Path:
        return self._parts.path / f"{first:07d}.mp4"

    def _picture(self, position: int) -> Path:
        return self._parts.path / f"{position:07d}.npy"

    def _encode(self, first: int) -> None:
        """Encode a piece from its pictures, if these are complete, and remove them.

        Another process may do the same, with the same result.
        """
        pictures = [self._picture(position) for position in self._positions(first)]
        piece = self._piece(first)
        if not piece.exists():
            if not all(path.exists() for path in pictures):
                return
            loaded = (_load(path) for path in pictures)
            try:
                encode_piece(piece, loaded, codec=self._plan.codec, rate=self._plan.rate)
            except FormatError:
                if not piece.exists():
                    raise
        for path in pictures:
            path.unlink(missing_ok=True)


def _load(path: Path) -> NDArray[Any]:
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (OSError, ValueError) as error:
        raise FormatError(
            f"{path}: is damaged; delete it and run the same command again"
        ) from error


def _same(comment: str | None, description: Mapping[str, str]) -> bool:
    """Return whether a file's comment describes the same video."""
    try:
        found = json.loads(comment or "null")
    except ValueError:
        return False
    return isinstance(found, dict) and difference(found, description) is None
