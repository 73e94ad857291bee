"""Video file written incrementally: finished frames survive any interruption of the render.

Encoders hold pictures back until they know the following ones, and files without their end are
unusable. So a folder beside the file, `NAME.parts`, holds the finished parts: pieces of a few
seconds, encoded so that they can be joined, and the pictures of the current piece, exactly as the
encoder will see them. When all are complete, the pieces become the file.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import replacing, require_regular
from iprt.output.encode import CodecName, encode_piece, join_pieces, planes, read_comment
from iprt.output.frames import FrameOutput
from iprt.output.metadata import difference
from iprt.output.sound import Sound

if TYPE_CHECKING:
    from iprt.renderer import RenderedFrame

PIECE_S = 2.0
"""Seconds of video per piece, which is also the distance of points that players can seek to."""
SUFFIX = ".parts"
DESCRIPTION = "job.json"


class Movie(FrameOutput):
    """Frames as a video file. Its folder must be locked.

    Parameters
    ----------
    frames : range
        Numbers of all frames of the file.
    description : mapping of str to str
        Identity of the video; kept in the file as its comment, in JSON.
    codec : {"h264", "hevc"}
    rate : Fraction
        Frames a second.
    additions : mapping of bytes to bytes
        See `join_pieces`.
    sound : Sound or None
        See `join_pieces`. Parts contain no sound and fit any.

    Raises
    ------
    FormatError
        Parts of a different render exist.
    """

    def __init__(
        self,
        path: Path,
        frames: range,
        description: Mapping[str, str],
        *,
        codec: CodecName,
        rate: Fraction,
        exposure: float,
        additions: Mapping[bytes, bytes] | None = None,
        sound: Sound | None = None,
    ) -> None:
        self.path = path
        self._codec, self._rate, self._exposure = codec, rate, exposure
        self._additions, self._sound = additions, sound
        self._length = max(round(PIECE_S * rate), 1)
        whole = {**description, "iprt:audio": "no" if sound is None else "yes"}
        self._comment = json.dumps(whole, sort_keys=True)
        self.parts = parts_of(path)
        self.finished = _same(read_comment(path), whole)
        super().__init__(frames, ())
        if self.finished:
            shutil.rmtree(self.parts, ignore_errors=True)
        else:
            self._open(description)
            self._missing.extend(self._absent())

    def _keep(self, index: int, picture: RenderedFrame, device: str) -> None:
        """Keep a frame; encode a piece when its last frame arrives."""
        position = self.frames.index(index)
        path = self._picture(position)
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.save(file, planes(picture.color, self._exposure, self._codec))
        self._encode(position - position % self._length)

    def finish(self) -> None:
        """Write the file, and remove the parts."""
        if self.finished:
            return
        pieces = [(first, self._piece(first)) for first in self._firsts()]
        joined = self.parts / f"joined{self.path.suffix}"
        join_pieces(
            joined,
            pieces,
            rate=self._rate,
            comment=self._comment,
            additions=self._additions,
            sound=self._sound,
        )
        require_regular(self.path)
        try:
            with joined.open("rb") as file:
                os.fsync(file.fileno())
            joined.replace(self.path)
        except OSError as error:
            raise FormatError(f"{self.path}: cannot be written: {error.strerror}") from error
        shutil.rmtree(self.parts, ignore_errors=True)
        self.finished = True

    def _open(self, description: Mapping[str, str]) -> None:
        """Create the folder of parts, or continue one of the same video."""
        file = self.parts / DESCRIPTION
        if self.parts.is_symlink():
            raise FormatError(f"{self.parts}: is a symbolic link; move it, or name another output")
        if not file.exists():
            if self.parts.exists() and any(self.parts.glob("[0-9]*")):
                raise FormatError(
                    f"{self.parts}: was not made by iprt; move it, or name another output"
                )
            with replacing(file) as temporary:
                temporary.write_text(json.dumps(dict(description), indent=2) + "\n", "utf-8")
        differs = difference(_read(file), description)
        if differs is not None:
            raise FormatError(
                f"{self.parts}: holds finished frames of another render: {differs}; delete this "
                "folder to start again, or name another output"
            )
        for path in self.parts.glob(".*.tmp"):
            path.unlink()
        for first in self._firsts():
            self._encode(first)

    def _absent(self) -> Iterator[int]:
        """Yield numbers of frames that no part holds."""
        for first in self._firsts():
            if not self._piece(first).exists():
                for position in self._positions(first):
                    if not self._picture(position).exists():
                        yield self.frames[position]

    def _firsts(self) -> range:
        """Return the first positions of pieces."""
        return range(0, len(self.frames), self._length)

    def _positions(self, first: int) -> range:
        return range(first, min(first + self._length, len(self.frames)))

    def _piece(self, first: int) -> Path:
        return self.parts / f"{first:07d}.mp4"

    def _picture(self, position: int) -> Path:
        return self.parts / f"{position:07d}.npy"

    def _encode(self, first: int) -> None:
        """Encode a piece from its pictures, if these are complete, and remove them."""
        pictures = [self._picture(position) for position in self._positions(first)]
        there = [path for path in pictures if path.exists()]
        if not self._piece(first).exists():
            if len(there) < len(pictures):
                return
            loaded = (_load(path) for path in pictures)
            encode_piece(self._piece(first), loaded, codec=self._codec, rate=self._rate)
        for path in there:
            path.unlink()


def parts_of(path: Path) -> Path:
    """Return the folder that holds the finished parts of a video file."""
    return path.with_name(path.name + SUFFIX)


def _load(path: Path) -> NDArray[Any]:
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (OSError, ValueError) as error:
        raise FormatError(
            f"{path}: is damaged; delete it and run the same command again"
        ) from error


def _read(path: Path) -> dict[str, str]:
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise FormatError(f"{path}: cannot be read; delete the folder it is in") from error
    return found if isinstance(found, dict) else {}


def _same(comment: str | None, description: Mapping[str, str]) -> bool:
    """Return whether a file's comment describes the same video."""
    try:
        found = json.loads(comment or "null")
    except ValueError:
        return False
    return isinstance(found, dict) and difference(found, description) is None
