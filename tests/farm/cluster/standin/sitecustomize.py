"""Replaces renders that workers start by pictures that tell of which frame and chunk they are.

Python imports it at its start where its folder is on PYTHONPATH. Processes, signals, files and
progress are the product's.

STANDIN_S: seconds of a frame. STANDIN_SEED: makes them random, up to twice that. STANDIN_DEVICE:
name of the device. STANDIN_FSIZE: most bytes of a file that a render writes. STANDIN_FAULTS: a
folder; a file such as `crash-3-1` in it lets one render of chunk 3 do that: crash, hang, lose its
device, or find bad input. STANDIN_LOG: a folder that gets a file for each render.
"""

from __future__ import annotations

import os
import resource
import runpy
import signal
import sys
import threading
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any


def fault(chunk: int) -> str:
    """Take a fault of a chunk."""
    for path in sorted(Path(os.environ.get("STANDIN_FAULTS", "/nowhere")).glob(f"*-{chunk}-*")):
        try:
            path.rename(path.with_name(f"had {path.name}"))
        except FileNotFoundError:  # another one was quicker
            continue
        return path.name.partition("-")[0]
    return ""


def end_by(kind: str) -> None:
    from iprt.errors import DeviceLostError, FormatError

    if kind == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if kind == "hang":
        threading.Event().wait()
    if kind == "lose":
        raise DeviceLostError("the device is lost")
    if kind == "bad":
        raise FormatError("frame 7: is damaged")


def render(words: list[str]) -> None:
    """Render the chunk that the words of `iprt render` name."""
    import random

    import numpy as np

    renderer: Any = ModuleType("iprt.renderer")  # slow to import
    renderer.RenderedFrame = lambda color, aovs: SimpleNamespace(color=color, aovs=aovs)
    sys.modules["iprt.renderer"] = renderer
    from iprt.files.lock import locked
    from iprt.files.progress_line import ProgressLine
    from iprt.output.film_output import FilmOutput
    from iprt.output.parts import Parts

    named = dict(word.split("=", 1) for word in words if word.startswith("--") and "=" in word)
    output, chunk = Path(named["--output"]), int(named["--chunks"])
    seconds = float(os.environ.get("STANDIN_S", "0"))
    dice = random.Random(f"{os.environ.get('STANDIN_SEED')} {chunk}")
    if log := os.environ.get("STANDIN_LOG"):
        told = f"{time.time()} {os.environ.get('STANDIN_DEVICE', '')}"
        Path(log, f"{chunk}-{os.getpid()}").write_text(told)
    with locked(output.parent, shared=True):
        plan = Parts(output).plan()
        film = FilmOutput(output, plan, [chunk])
        frames, missing = plan.chunks.frames_of(chunk), film.missing(chunk)
        first, ends = frames[0], fault(chunk)
        for place, index in enumerate(range(first - plan.chunks.warm_up, frames[-1] + 1)):
            time.sleep(seconds * (2.0 * dice.random() if "STANDIN_SEED" in os.environ else 1.0))
            if place == len(frames):
                end_by(ends)
            if index in missing:
                shades = np.random.default_rng([index + 1000, first])
                color = shades.random((16, 32, 3)).astype(np.float32)
                film.write(chunk, index, renderer.RenderedFrame(color, {}), "a device")
            print(ProgressLine(film.done, film.total), file=sys.stderr, flush=True)
        film.fade(chunk)


def main(*_: object, **__: object) -> None:
    """Do what `iprt` would."""
    from iprt.errors import IprtError
    from iprt.files.termination import end_on_signals

    end_on_signals()
    if limit := os.environ.get("STANDIN_FSIZE"):
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), int(limit)))
    try:
        render(sys.argv[1:])
    except IprtError as error:
        print(f"iprt: error: {error}", file=sys.stderr)
        sys.exit(error.exit_code)


def skew(hours: float) -> None:
    """Change the clock, and the times of files that are written."""
    now, replace = time.time, os.replace
    time.time = lambda: now() + 3600.0 * hours
    time.time_ns = lambda: int(1e9 * time.time())

    def skewed(source: Any, target: Any) -> None:
        os.utime(source, (time.time(), time.time()))
        replace(source, target)

    os.replace = skewed


def replace_device() -> None:
    from iprt.device import choose

    name = os.environ.get("STANDIN_DEVICE", "a device")
    info = SimpleNamespace(name=name, platform="none")
    choose.choose = lambda spec=None: SimpleNamespace(info=info)


if "STANDIN_SKEW_H" in os.environ:
    skew(float(os.environ["STANDIN_SKEW_H"]))
if "iprt.farm.child" in sys.orig_argv:
    runpy.run_module = main
elif "iprt.farm.examine" in sys.orig_argv:
    replace_device()
