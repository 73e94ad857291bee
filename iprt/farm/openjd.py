"""Job template in the form of Open Job Description (jobtemplate-2023-09), for farms of studios.

Its render step has a task for each chunk, and the extension TASK_CHUNKING lets a farm put several
into one run. The specification leaves retries to the farm. A run tries once more by itself.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable
from pathlib import Path

from iprt.errors import IprtError
from iprt.farm import submission
from iprt.farm.submission import Submission, iprt
from iprt.files.message_text import printable
from iprt.output.chunks import chunk_ranges

LONGEST_NAME, LONGEST_VALUE = 128, 1024
"""Most characters of a job's name and of a parameter's value, by the specification."""

TEMPLATE = """\
# Renders {film}. A farm asks for the two folders; to run all on this machine:
#     openjd run THIS_FILE -p {scene} -p {folder}
# After an interruption or a failure, make a new template by the same `iprt farm openjd`:
# it names the chunks that are still missing.
specificationVersion: jobtemplate-2023-09
extensions: [TASK_CHUNKING]
name: {name}
parameterDefinitions:
- name: Scene
  type: PATH
  objectType: DIRECTORY
  dataFlow: IN
  description: Scene folder.
- name: Folder
  type: PATH
  objectType: DIRECTORY
  dataFlow: INOUT
  description: Folder of the film and of its parts, which all workers share.
- name: Iprt
  type: STRING
  default: {program}
  description: The command iprt on a worker.
steps:
- name: render
  parameterSpace:
    taskParameterDefinitions:
    - name: Chunk
      type: CHUNK[INT]
      range: {range}
      chunks:
        defaultTaskCount: {group}
        targetRuntimeSeconds: {target}
        rangeConstraint: CONTIGUOUS
  hostRequirements:
    attributes:
    - name: attr.worker.os.family
      anyOf: [linux, macos]{amounts}
  script:
    embeddedFiles:
    - name: Twice
      type: TEXT
      filename: twice.sh
      data: |
        # Run the command behind this. Bad input (2) and signals are no reason to try again.
        "$@" && exit
        code=$?
        case $code in
        2 | 129 | 130 | 143) ;;
        *)
            echo "openjd_status: failed with exit code $code; tried again"
            "$@" && exit
            code=$?
            ;;
        esac
        echo "openjd_fail: iprt failed with exit code $code; the log's last lines tell why"
        exit "$code"
    actions:
      onRun:
        command: sh
        args:
        - "{{{{Task.File.Twice}}}}"
{words}
- name: join
  dependencies:
  - dependsOn: render
  script:
    actions:
      onRun:
        command: "{{{{Param.Iprt}}}}"
        args:
        - join
        - {output}
"""
"""Braces are doubled for `str.format`."""


def require_words(words: Iterable[str]) -> None:
    """Refuse words that a template cannot hold.

    Raises
    ------
    IprtError
        A word has characters that the format gives a meaning, or is too long for it.
    """
    words = tuple(words)
    submission.require_words(words)
    for word in words:
        if "{{" in word or len(word) > LONGEST_VALUE:
            raise IprtError(
                f"{printable(word)}: Open Job Description takes no {{{{ and at most "
                f"{LONGEST_VALUE} characters; rename it"
            )


def template(film: Submission) -> str:
    """Return the template as YAML."""
    words = ["{{Param.Iprt}}", film.words[0], "{{Param.Scene}}"]
    for word in film.words[2:]:
        flag, _, value = word.partition("=")
        if flag in ("--output", "--settings"):
            words.append(f"{flag}={_in_folder(film.output.parent, Path(value))}")
        else:
            words.append(word)
    words += ["--chunks={{Task.Param.Chunk}}", "--progress=openjd"]
    return TEMPLATE.format(
        name=_text(f"iprt {film.output.name}"[:LONGEST_NAME]),
        film=film.output,
        scene=shlex.quote(f"Scene={film.scene}"),
        folder=shlex.quote(f"Folder={film.output.parent}"),
        program=_text(iprt()),
        range=_text(chunk_ranges(tuple(film.numbers))),
        group=film.group,
        target=round(film.target_s),
        amounts=_amounts(film.gpus),
        words="\n".join(f"        - {_text(word)}" for word in words),
        output=_text(_in_folder(film.output.parent, film.output)),
    )


def _in_folder(folder: Path, path: Path) -> str:
    """Return the place of a file on a worker, which may have the folder elsewhere."""
    return f"{{{{Param.Folder}}}}/{path.relative_to(folder)}"


def _amounts(gpus: int) -> str:
    """Return the lines that reserve GPUs."""
    return (
        f"""
    amounts:
    - name: amount.worker.gpu
      min: {gpus}"""
        if gpus
        else ""
    )


def _text(value: str) -> str:
    """Return a text as a quoted YAML scalar, which JSON's are."""
    return json.dumps(value, ensure_ascii=False)
