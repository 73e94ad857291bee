"""Contents of a folder by its layout, before cameras and conventions are settled."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from iprt.capture.pinhole import Pinhole
from iprt.errors import FormatError
from iprt.files.kinds import PICTURE_SUFFIXES
from iprt.files.message_text import counted

Matrix = NDArray[np.float64]
Axis = Literal["x", "-x", "y", "-y", "z", "-z"]
Convention = Literal["opencv", "opengl", "opencv-from-world", "opengl-from-world"]
MILLIMETRE = 0.001


@dataclass(frozen=True)
class FrameFiles:
    """Files of a frame, its pose as stored, and its own camera if the layout gives one."""

    color: Path
    depth: Path
    pose: Matrix
    camera: Pinhole | None = None


@dataclass
class Found:
    """Frames of a folder.

    Attributes
    ----------
    name : str
        Name of the layout, for messages.
    step_m : float
        Metres per step of integer depth.
    convention : str
        Convention of the poses by the layout's definition.
    up : str or None
        Axis of the poses' world that points up by the layout's definition.
    frames : list of FrameFiles
        Complete frames in order.
    skipped : Counter
        Counts of unusable frames, by reason.
    """

    name: str
    step_m: float = MILLIMETRE
    convention: Convention = "opencv"
    up: Axis | None = None
    frames: list[FrameFiles] = field(default_factory=list)
    skipped: Counter[str] = field(default_factory=Counter)

    def __str__(self) -> str:
        kept = f"{self.name}, {counted(len(self.frames), 'frame')}"
        return f"{kept}; skipped: {self._why}" if self.skipped else kept

    @property
    def _why(self) -> str:
        return ", ".join(f"{count} {reason}" for reason, count in sorted(self.skipped.items()))

    def add(
        self,
        color: Path | None,
        depth: Path | None,
        pose: Matrix | None,
        camera: Pinhole | None = None,
        *,
        has_pose: bool = True,
    ) -> None:
        """Add a frame; None means a missing part, or a pose that is not finite."""
        if color is None:
            self.skipped["without color"] += 1
        elif depth is None:
            self.skipped["without depth"] += 1
        elif pose is None:
            self.skipped["with an invalid pose" if has_pose else "without a pose"] += 1
        else:
            self.frames.append(FrameFiles(color, depth, pose, camera))

    def complete(self, source: Path) -> Self:
        """Return itself; raise FormatError about `source` if there are no frames."""
        if not self.frames:
            raise FormatError(
                f"{source}: no frame with color, depth and a pose ({self._why or 'none'})"
            )
        return self


def by_number(
    folder: Path, pattern: str, suffixes: tuple[str, ...] = PICTURE_SUFFIXES
) -> dict[int, Path]:
    """Return the files of a folder whose stems match, by the number in the first group."""
    found = {}
    names = re.compile(pattern)
    if folder.is_dir():
        for path in sorted(folder.iterdir()):
            match = names.fullmatch(path.stem)
            if match and path.suffix.lower() in suffixes:
                found[int(match[1])] = path
    return found
