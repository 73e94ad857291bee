"""Names of the files that a new scene is to be made from, and what is wrong with them."""

from __future__ import annotations

import re
from collections import Counter
from itertools import islice
from pathlib import Path

from iprt.errors import SceneError
from iprt.files.problems import FRAME_PATTERN, PICTURE_SUFFIXES
from iprt.files.untrusted import is_file
from iprt.files.wording import counted
from iprt.footage.video.container import is_container

MAX_LISTED = 100_000
"""Files of a folder that are looked at."""
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*)")


def require_sources(sources: dict[str, Path]) -> None:
    """Raise SceneError for folders, missing files, and a picture without depth.

    Parameters
    ----------
    sources : dict of str to Path
        By their flag without dashes: color, and depth and normal where they are given.
    """
    for key, path in sources.items():
        if path.is_dir():
            pattern = pattern_in(path)
            raise SceneError(
                f"--{key} {path}: is a folder; name a picture or a video file in it"
                if pattern is None
                else f"--{key} {path}: is a folder; its numbered pictures are named by a pattern: "
                f"--{key} {path / pattern}"
            )
        if not FRAME_PATTERN.search(path.name) and not is_file(path):
            raise SceneError(f"--{key} {path}: no such file")
    color = sources["color"]
    if "depth" not in sources and not is_container(Path(), str(color)):
        raise SceneError(
            f"--depth is missing: {color} is a picture and holds no depth; give a picture of depth "
            "of the same view: EXR or PFM in metres, or 16-bit grey PNG with --depth-scale "
            "(docs/footage.md names programs that estimate depth)"
        )


def require_frames(pattern: Path, files: list[Path]) -> None:
    """Raise SceneError if some of the files that a pattern names are not there."""
    missing = [file for file in files if not is_file(file)]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise SceneError(
            f"{pattern}: of {counted(len(files), 'picture')}, {missing[0].name}{more} missing; "
            "number the pictures without gaps"
        )


def pattern_in(folder: Path) -> str | None:
    """The printf pattern that names most numbered pictures in a folder; None: there are none."""
    found: Counter[str] = Counter()
    for path in islice(folder.iterdir(), MAX_LISTED):
        match = _NUMBERED.fullmatch(path.stem)
        if match is None or path.suffix.lower() not in PICTURE_SUFFIXES:
            continue
        before, number, after = match.groups()
        padded = number.startswith("0") and 1 < len(number) < 10
        found[f"{before}%{f'0{len(number)}' if padded else ''}d{after}{path.suffix}"] += 1
    # Numbers without a leading zero may still be padded ones: color.0999.png, color.1000.png.
    for name in [name for name in found if "%0" in name]:
        found[name] += found.get(re.sub(r"%0\d", "%", name), 0)
    (best, count), *_ = found.most_common(1) or [("", 0)]
    return best if count > 1 else None
