"""Try a driver or an optional part in a process of its own: `python -m iprt.commands.probe NAME`.

OpenCL, OpenGL and LLVM can end the process that calls them. So each is tried in a child, which
prints one JSON object; a child that dies, hangs or raises becomes an `error` in the record.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from iprt.files.termination import at_termination

Record = dict[str, Any]
TIMEOUT_S = 120.0


def probe(
    name: str, timeout_s: float = TIMEOUT_S, variables: Mapping[str, str] | None = None
) -> Record:
    """The record that the probe `name` of `PROBES` prints, or `{"error": why}`.

    `variables` are added to its environment.
    """
    package_parent = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, (package_parent, os.environ.get("PYTHONPATH"))))
    try:
        child = subprocess.Popen(
            [sys.executable, "-m", "iprt.commands.probe", name],
            env={**os.environ, "PYTHONPATH": path, **(variables or {})},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
    except OSError as error:
        return {"error": f"no process can be started: {error}"}
    with child, at_termination(child.kill):
        try:
            stdout, stderr = child.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            child.kill()
            return {"error": f"no answer within {timeout_s:.0f} s"}
    return read_record(child.returncode, stdout, stderr)


def read_record(status: int, stdout: str, stderr: str) -> Record:
    """Answer of a child process: the JSON object in the last line of `stdout`, if it ended well."""
    if status < 0:
        return {"error": f"the process was ended by {signal.Signals(-status).name}"}
    try:
        record: Record = json.loads(stdout.strip().splitlines()[-1])
    except (IndexError, json.JSONDecodeError):
        last = (stderr.strip().splitlines() or ["no output"])[-1]
        return {"error": f"the process ended with status {status}: {last}"}
    return record


def opencl() -> Record:
    """Devices, the one that would be used, and why."""
    from iprt.device.choose import choose, describe_devices
    from iprt.errors import IprtError

    infos = describe_devices()
    try:
        choice = choose()
        answer = {"chosen": choice.info.index, "reason": choice.reason}
    except IprtError as error:  # PYOPENCL_CTX may fit no device
        answer = {"error": str(error)}
    devices = []
    for info in infos:
        record = {key: value for key, value in vars(info).items() if key != "handle"}
        devices.append(record | {"chosen": info.index == answer.get("chosen")})
    return {"devices": devices, **answer}


def opengl() -> Record:
    """The renderer behind an OpenGL context made through EGL, without a display."""
    from iprt.raster.context import create_context

    info = create_context().info
    renderer = info["GL_RENDERER"]
    software = any(name in renderer.lower() for name in ("llvmpipe", "softpipe", "swrast"))
    return {
        "renderer": renderer,
        "vendor": info["GL_VENDOR"],
        "version": info["GL_VERSION"],
        "software": software,
    }


def mitsuba() -> Record:
    """The variant of Mitsuba that runs here, and the LLVM it compiles with."""
    from iprt.truth.backend import mitsuba as load

    return {"variant": load().variant(), "llvm": os.environ.get("DRJIT_LIBLLVM_PATH")}


def window() -> Record:
    """Whether `iprt view` can open a window."""
    from iprt.viewer.needs import WINDOW, require_window

    if record := _lacking(WINDOW):
        return record
    require_window()
    return {}


def browser() -> Record:
    """Whether `iprt view --web` can serve."""
    from iprt.viewer.needs import BROWSER

    return _lacking(BROWSER)


def _lacking(modules: Sequence[str]) -> Record:
    from iprt.viewer.needs import install_command, lacking

    problems = lacking(modules)
    return {"error": ", ".join(problems), "install": install_command()} if problems else {}


PROBES: dict[str, Callable[[], Record]] = {
    "opencl": opencl,
    "opengl": opengl,
    "mitsuba": mitsuba,
    "window": window,
    "browser": browser,
}


def main() -> None:
    try:
        record = PROBES[sys.argv[1]]()
    except Exception as error:  # whatever a driver raises is the answer to the question
        record = {"error": f"{error}" or type(error).__name__}
    print(json.dumps(record))


if __name__ == "__main__":
    main()
