"""Process that reads a USD file: `python -m iprt.geometry.usd_child`.

USD trusts the sizes that a file declares, and prints some complaints to stderr by itself. Whatever
a damaged file does to it ends this process only, which has a limit of memory and of time.
"""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np

from iprt.errors import FormatError
from iprt.files.message_text import printable
from iprt.geometry.usd_data import UsdContents

MOST_MEMORY = 2**33
"""Bytes of address space, some of which libraries reserve without using."""
MOST_SECONDS = 600
"""Limit for the processor time."""


def read_stage(root: Path, within: Path, shown: Path, arrays: Path) -> UsdContents:
    """Read a USD file, and write its arrays to the file `arrays`, as `placed_arrays` names them.

    Parameters
    ----------
    root : Path
        The file; absolute.
    within : Path
        Folder that must hold all layers, with links resolved.
    shown : Path
        Name of the file in errors.
    """
    from iprt.geometry.usd_layers import Layers
    from iprt.geometry.usd_stage import StageReader, placed_arrays

    try:
        layers = Layers(root, within, shown)
        reader = StageReader(layers)
    except FormatError as error:
        return UsdContents(error=str(error))
    except Exception as error:
        return UsdContents(error=f"{shown}: cut off or damaged USD file{_reason(error, root)}")
    with arrays.open("wb") as file:
        named: dict[str, Any] = dict(placed_arrays(reader))
        np.savez(file, **named)
    return UsdContents(
        materials=reader.materials.read,
        placed=reader.placed,
        layers=layers.others,
        textures=list(reader.materials.textures),
        unread=list(reader.unread),
    )


def _reason(error: Exception, root: Path) -> str:
    """Return the first fault in an error of USD, whose text names places in its own code."""
    text = " ".join(str(error).split()).replace(f"{root.parent}/", "")
    _, colon, told = text.partition(" : '")
    text = told.partition("' Error in ")[0].rstrip("'") if colon else text
    return f" ({printable(text.strip(), 200)})" if text else ""


def main() -> None:
    """Read the request from stdin, as JSON, and print the contents, as JSON."""
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS))
    request = json.load(sys.stdin)
    print(
        read_stage(
            *(Path(request[key]) for key in ("root", "within", "shown", "arrays"))
        ).model_dump_json()
    )


if __name__ == "__main__":
    main()
