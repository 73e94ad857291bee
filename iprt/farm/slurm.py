"""Script that renders a film as an array job of SLURM."""

from __future__ import annotations

import math
import re
import shlex

from iprt.farm.submission import Submission, iprt
from iprt.output.chunks import chunk_ranges

MOST_TASKS = 1000
"""Longest array that SLURM takes as it comes (MaxArraySize 1001)."""
RETRIES = 2

SCRIPT = """\
#!/bin/sh
#SBATCH --job-name={name}
#SBATCH --array=0-{last}{at_once}
#SBATCH --requeue
#SBATCH --open-mode=append
{options}
# Renders {film} with SLURM:
#     sh THIS_FILE [OPTIONS OF sbatch FOR ALL JOBS, such as --partition=NAME]
# After an interruption or a failure, make a new script by the same `iprt farm slurm`: it
# names the chunks that are still missing.
#
# All nodes must see these under the same paths:
#     the scene    {scene}
#     the output   {folder}
#     the program  {program}
set -eu

if [ -z "${{SLURM_ARRAY_TASK_ID:-}}" ]; then
    if [ ! -f "$0" ]; then
        echo "save this script to a file, and run: sh FILE" >&2
        exit 2
    fi
    tasks=$(sbatch --parsable "$@" "$0")
    tasks=${{tasks%%;*}}
    # Whether or not all tasks succeed: the join names the chunks that are missing.
    join=$(sbatch --parsable "$@" --job-name={name}-join --dependency="afterany:$tasks" <<'JOIN'
#!/bin/sh
exec {join}
JOIN
    )
    echo "job $tasks renders, job ${{join%%;*}} makes the film"
    exit
fi

# The chunks of each task.
set -- \\
{groups}
shift "$SLURM_ARRAY_TASK_ID"

code=0
{render} --chunks="$1" || code=$?
case $code in
0 | 2 | 129 | 130 | 143) exit "$code" ;; # done, bad input, or stopped
esac
# The device or its driver may be at fault: another node may do better.
if [ "${{SLURM_RESTART_COUNT:-0}}" -lt {retries} ]; then
    scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
"""
"""Braces are doubled for `str.format`."""


def script(film: Submission, at_once: int | None = None) -> str:
    """Return a shell script that submits itself as an array job, and a job that joins its chunks.

    Parameters
    ----------
    at_once : int or None
        Most tasks that may run at the same time; None: any number.
    """
    group = max(film.group, -(-len(film.numbers) // MOST_TASKS))
    starts = range(0, len(film.numbers), group)
    groups = [chunk_ranges(tuple(film.numbers[start : start + group])) for start in starts]
    options = [f"#SBATCH --gres=gpu:{film.gpus}"] if film.gpus else []
    limit = film.limit_s(group)
    if limit is not None:
        options.append(f"#SBATCH --time={math.ceil(limit / 60.0)}")
    program = iprt()
    return SCRIPT.format(
        name="iprt-" + re.sub(r"[^\w.-]", "_", film.output.name, flags=re.ASCII),
        last=len(groups) - 1,
        at_once="" if at_once is None else f"%{at_once}",
        options="\n".join([*options, "#"]),
        film=film.output,
        scene=film.scene,
        folder=film.output.parent,
        program=program,
        join=shlex.join([program, "join", str(film.output)]),
        groups=_wrapped(groups),
        render=shlex.join([program, *film.words]),
        retries=RETRIES,
    )


def _wrapped(words: list[str]) -> str:
    """Return words as continued lines of a shell command, ten a line."""
    lines = [" ".join(words[start : start + 10]) for start in range(0, len(words), 10)]
    return " \\\n".join(f"    {line}" for line in lines)
