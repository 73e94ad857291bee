"""`iprt join`: a film from chunks that were rendered apart."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.output.film_output import FilmOutput
    from iprt.output.film_plan import FilmPlan

LOG = logging.getLogger("iprt.render")
MOST_NAMED = 8
"""Most incomplete chunks that an error names."""


def join(output: tyro.conf.Positional[Path], /, *, no_audio: bool = False) -> int:
    """Make the film of chunks that `iprt render --chunks` has rendered.

    Names the chunks that are missing, if any, and changes nothing then.

    Parameters
    ----------
    output
        Video file or numbered pictures, as in `iprt render -o`.
    no_audio
        Leave out the sound.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.output.parts import Parts

    parts = Parts(output)
    if not parts.path.is_dir():
        raise IprtError(
            f"{output}: has no folder {parts.path.name}; render its chunks first "
            "(iprt render --chunks), with the same -o"
        )
    plan = parts.plan()
    if no_audio:
        plan = replace(plan, sound=None)
    elif plan.sound is not None and not plan.sound.path.exists():
        raise IprtError(
            f"{plan.sound.path}: the film's sound is not there; join where it is, or add --no-audio"
        )
    join_chunks(output, plan)
    print(output)
    return 0


def join_chunks(output: Path, plan: FilmPlan) -> None:
    """Make a film of its chunks.

    Raises
    ------
    IprtError
        Chunks are missing, a part is damaged, or the film cannot be written.
    """
    from iprt.files.lock import locked

    with locked(output.parent):
        target = whole_film(output, plan)
        if not target.complete:
            raise IprtError(f"{output}: {_incomplete(target)}")
        target.clean()
        target.finish()


def whole_film(output: Path, plan: FilmPlan) -> FilmOutput:
    """Return all chunks of a film.

    Raises
    ------
    FormatError
        Parts of a different film exist, or frames of one are in the way.
    """
    from iprt.output.film_output import FilmOutput

    # Each frame of a moving view has its own.
    common = {key: text for key, text in plan.identity.items() if key != "iprt:view"}
    return FilmOutput(output, plan, plan.chunks.numbers, lambda _: common)


def _incomplete(target: FilmOutput) -> str:
    """Return in words which frames of which chunks are missing."""
    from iprt.files.message_text import counted
    from iprt.output.chunks import chunk_ranges

    absent = {n: target.missing(n) for n in target.numbers if target.missing(n)}
    named = [
        f"{number} (frames {missing[0]} to {missing[-1]})"
        for number, missing in list(absent.items())[:MOST_NAMED]
    ]
    more = "" if len(absent) <= MOST_NAMED else f" and {len(absent) - MOST_NAMED} more"
    numbers = chunk_ranges(tuple(absent))
    return (
        f"{counted(len(absent), 'chunk')} of {len(target.numbers)} missing: "
        f"{', '.join(named)}{more}; render with --chunks {numbers}"
    )
