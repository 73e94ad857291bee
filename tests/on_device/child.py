"""Runs the cases of a step, and writes what comes of each to a pipe as a line of JSON.

`python -m tests.on_device.child PIPE MODULE DEVICE UNTIL [DONE...]`. An exception ends the
process with its case: what the driver is worth after it is not known.
"""

from __future__ import annotations

import json
import os
import sys
import time
import traceback
from importlib import import_module
from typing import Any

from tests.on_device.cases import Asked, Cases


def main(pipe: str, module: str, device: str, until: str, *done: str) -> int:
    """The command; returns 1 after an exception."""
    with os.fdopen(int(pipe), "w", encoding="utf-8") as out:

        def tell(**message: Any) -> None:
            print(json.dumps(message), file=out, flush=True)

        try:
            cases: Cases = import_module(module).cases(Asked(device, float(until)))
        except Exception as error:
            traceback.print_exc()
            tell(failed=_named(error))
            return 1
        tell(cases=list(cases))
        for name, run in cases.items():
            if name in done:
                continue
            if time.monotonic() >= float(until):
                break
            tell(begin=name)
            start = time.monotonic()
            try:
                rows = run()
            except Exception as error:
                traceback.print_exc()
                tell(problem=_named(error))
                return 1
            tell(rows=rows, seconds=round(time.monotonic() - start, 2))
    return 0


def _named(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:400]}"


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
