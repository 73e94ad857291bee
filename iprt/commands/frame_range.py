"""`--frames`: ranges of frames of a video."""

from __future__ import annotations

import re

from iprt.errors import IprtError

_RANGE = re.compile(r"(\d*)(?:(:)(\d*)(?::(\d+))?)?", re.ASCII)
_DIGITS = 9


def frame_range(text: str | None, there: range) -> range:
    """Parse the value of `--frames` to a range of frame numbers.

    Parameters
    ----------
    text : str or None
        `FIRST:LAST` or `FIRST:LAST:STEP`, both ends included; a missing end is the video's. `N` is
        one frame. None: all frames.
    there : range
        Numbers of the video's frames.

    Raises
    ------
    IprtError
        The text has another form, or the video has no such frames.
    """
    if text is None:
        return there
    match = _RANGE.fullmatch(text)
    if match is None or not text or any(len(part or "") > _DIGITS for part in match.groups()):
        raise IprtError(f"--frames {text}: expected FIRST:LAST, FIRST:LAST:STEP, or one number")
    first = int(match[1] or there[0])
    last = int(match[3] or there[-1]) if match[2] else first
    step = 1 if match[4] is None else int(match[4])
    for index in (first, last):
        if index not in there:
            raise IprtError(
                f"--frames {text}: there is no frame {index}; the video has {there[0]} to "
                f"{there[-1]}"
            )
    if first > last:
        raise IprtError(
            f"--frames {text}: the first frame comes after the last; give the lower number first"
        )
    if step == 0:
        raise IprtError(f"--frames {text}: the step is 0; expected 1 or more")
    return range(first, last + 1, step)
