"""Try a driver or an optional part in a process of its own: `python -m iprt.commands.probe NAME`.

OpenCL, OpenGL and LLVM can end the process that calls them. So each is tried in a child process,
which prints one JSON object. A child that dies, hangs or raises becomes an `error` in the record.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Any

Record = dict[str, Any]
TIMEOUT_S = 120.0


def probe(
    name: str, variables: Mapping[str, str] | None = None, timeout_s: float = TIMEOUT_S
) -> Record:
    """Run the probe `name` of `PROBES` in a child; return its record, or `{"error": reason}`.

    `variables` are added to the child's environment.
    """
    try:
        child = subprocess.run(
            [sys.executable, "-m", "iprt.commands.probe", name],
            env={**os.environ, **(variables or {})},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout_s,
            check=False,
        )
    except OSError as error:
        return {"error": f"no process can be started: {error}"}
    except subprocess.TimeoutExpired:
        return {"error": f"no answer within {timeout_s:.0f} s"}
    return read_record(child.returncode, child.stdout, child.stderr)


def read_record(status: int, stdout: str, stderr: str) -> Record:
    """Return the JSON object in the last line of a child's `stdout`, or an error."""
    if status < 0:
        return {"error": f"the process was ended by {signal.Signals(-status).name}"}
    try:
        record: Record = json.loads(stdout.strip().splitlines()[-1])
    except (IndexError, json.JSONDecodeError):
        last = (stderr.strip().splitlines() or ["no output"])[-1]
        return {"error": f"the process ended with status {status}: {last}"}
    return record


def opencl() -> Record:
    """List the devices, the one that would be used, and the reason for it."""
    from iprt.device.choose import choose, describe_devices
    from iprt.errors import IprtError

    infos = describe_devices()
    try:
        choice = choose()
        answer = {"chosen": choice.info.index, "reason": choice.reason}
    except IprtError as error:  # PYOPENCL_CTX may fit no device
        answer = {"error": str(error)}
    return {"devices": [info.plain() for info in infos], **answer}


def opengl() -> Record:
    """Name the renderer of an OpenGL context made through EGL, without a display."""
    from iprt.raster.context import create_context

    info = create_context().info
    renderer = info["GL_RENDERER"]
    software = any(name in renderer.lower() for name in ("llvmpipe", "softpipe", "swrast"))
    return {"found": f"{renderer}, {info['GL_VERSION']}", "software": software}


def mitsuba() -> Record:
    """Name the variant of Mitsuba that runs here, and the LLVM that it compiles with."""
    from iprt.truth.backend import vector_mitsuba

    variant = vector_mitsuba().variant()
    return {"found": f"{variant}, {os.environ.get('DRJIT_LIBLLVM_PATH', 'its own LLVM')}"}


def window() -> Record:
    """Raise an error if `iprt view` cannot open a window."""
    from iprt.viewer.requirements import require_window

    require_window()
    return {"found": "works"}


def browser() -> Record:
    """Raise an error if `iprt view --web` cannot serve."""
    from iprt.viewer.requirements import require_browser

    require_browser()
    return {"found": "works"}


PROBES: dict[str, Callable[[], Record]] = {
    what.__name__: what for what in (opencl, opengl, mitsuba, window, browser)
}


def main() -> None:
    """Print the record of the probe that the command line names."""
    try:
        record = PROBES[sys.argv[1]]()
    except Exception as error:  # the record reports any error of a driver
        record = {"error": f"{error}" or type(error).__name__}
    print(json.dumps(record))


if __name__ == "__main__":
    main()
