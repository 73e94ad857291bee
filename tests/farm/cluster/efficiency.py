"""Figures of rendering on a cluster, as JSON: `python -m tests.farm.cluster.efficiency [PART ...]`.

Parts: `workers` (efficiency of 1, 2 and 4 workers with sleeps in place of a device), `tasks` (time
of the scheduler and of the client for each task), `start` (time and bytes of a real render of a
chunk), `devices` (one and two workers on one device). Default: all.
"""

from __future__ import annotations

import json
import os
import platform
import sys
import tempfile
import time
import uuid
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import iprt
from iprt.commands.render import render
from iprt.commands.render_flags import RenderFlags
from iprt.commands.render_video import film_plan
from iprt.farm.cluster import connected
from iprt.farm.dispatch import Dispatch
from iprt.farm.order import Order, Outcome
from iprt.farm.task import environment
from iprt.files.progress_line import ProgressLine
from iprt.output.chunks import fade
from tests.clips import write_clip
from tests.farm.cluster.machines import STANDIN

FRAME_S, CHUNKS, CHUNK = 0.25, 48, 8
WARM_UP = 8
DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")


def by_workers(folder: Path) -> dict[str, Any]:
    """Wall seconds of a film whose frames sleep, by the number of workers."""
    clip = write_clip(folder / "clip", CHUNKS * CHUNK)
    os.environ.update(PYTHONPATH=str(STANDIN), STANDIN_S=str(FRAME_S))
    seconds = {}
    for count in (1, 2, 4):
        flags = RenderFlags(output=folder / str(count) / "film.mp4", chunk=CHUNK, device=DEVICE)
        start = time.monotonic()
        render(clip, flags=flags, cluster=f"local:{count}")
        seconds[count] = time.monotonic() - start
    del os.environ["PYTHONPATH"], os.environ["STANDIN_S"]
    return {
        "chunks": CHUNKS,
        "frames": CHUNKS * CHUNK,
        "rendered_frames": CHUNKS * (CHUNK + WARM_UP),
        "seconds_per_frame": FRAME_S,
        "seconds": {str(count): round(took, 2) for count, took in seconds.items()},
        "efficiency": {
            str(count): round(seconds[1] / (count * took), 3) for count, took in seconds.items()
        },
    }


def nothing(order: Order, number: int) -> Outcome:
    """Render nothing."""
    return Outcome(0, 0, 0.0)


def admitted(order: Order, token: str) -> dict[str, str]:
    """Find nothing wrong."""
    return {"device": "a device", "mark": token}


def by_tasks(folder: Path) -> dict[str, Any]:
    """Milliseconds of each of many empty tasks, by dask alone and by the dispatch of chunks."""
    found: dict[str, Any] = {"workers": 2}
    with connected(None, ["0:0"] * 2) as client:
        for count in (1000, 10_000):
            start = time.monotonic()
            client.gather(client.map(_nothing, range(count), pure=False))
            raw = time.monotonic() - start
            order = Order((), "", False, "", str(folder), None, 0, "", uuid.uuid4().hex, 60.0)
            chunks = dict.fromkeys(range(count), (1, 0))
            start = time.monotonic()
            Dispatch(client, order, chunks, lambda _: True, render=nothing, look=admitted).run()
            own = time.monotonic() - start
            found[str(count)] = {
                "dask_ms_per_task": round(1e3 * raw / count, 3),
                "dispatch_ms_per_task": round(1e3 * own / count, 3),
            }
    return found


def _nothing(number: int) -> int:
    return number


def of_start(folder: Path) -> dict[str, Any]:
    """Start of a real render of a chunk, and the bytes that it reads and writes."""
    import subprocess

    found: dict[str, Any] = {}
    size = (512, 512)
    clip = write_clip(folder / "real", 2 * CHUNK, fps=24.0, size=size)
    output = folder / "real.mp4"
    flags = RenderFlags(output=output, chunk=CHUNK, accumulate=2, device=DEVICE)
    frames = len(film_plan(flags.job(clip)).chunks.frames)
    words = ["render", str(clip), f"--output={output}", f"--chunk={CHUNK}", "--accumulate=2"]
    words += [f"--device={DEVICE}", "--chunks=1", "--progress=lines"]
    for name in ("first", "again"):
        start = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "iprt.farm.child", *words],
            env=environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,
        )
        assert process.stderr is not None
        before, first, read = None, None, (0, 0)
        for line in process.stderr:
            progress = ProgressLine.of(line.rstrip())
            if progress is None:
                continue
            if before is None:
                before = time.monotonic() - start
            if progress.done and first is None:
                first = time.monotonic() - start
            read = _bytes(process.pid)
        process.wait()
        found[name] = {
            "seconds_to_process_ready": round(before or 0.0, 2),
            "seconds_to_first_kept_frame": round(first or 0.0, 2),
            "seconds": round(time.monotonic() - start, 2),
            "bytes_read": read[0],
            "bytes_written": read[1],
        }
        parts = output.with_name(output.name + ".parts")
        found["bytes_in_parts"] = sum(path.stat().st_size for path in parts.iterdir())
        for path in parts.glob("[0-9]*"):
            path.unlink()
    found |= {"size": size, "frames_of_clip": frames, "frames_of_chunk": CHUNK}
    return found | {"per_frame": by_size()}


def _bytes(pid: int) -> tuple[int, int]:
    """Bytes that a process has read and written by system calls, from files and pipes."""
    told = dict(
        line.split(": ") for line in Path(f"/proc/{pid}/io").read_text().strip().splitlines()
    )
    return int(told["rchar"]), int(told["wchar"])


def by_size(length: int = 120, piece: int = 48, warm_up: int = 8) -> dict[str, Any]:
    """Bytes of intermediate files that each frame of a video file has written and read.

    Planes of 8 bits, 4:2:0, are written once and read once for their piece. A frame of a fade has
    two sides of three 16-bit floats, written once and read once.
    """
    found = {}
    for name, pixels in (("512x512", 512 * 512), ("3840x2160", 3840 * 2160)):
        planes = pixels * 3 // 2
        sides = 2 * fade(warm_up) * pixels * 6 / length
        found[name] = {
            "planes": planes,
            "sides": round(sides),
            "both_ways": round(2 * (planes + sides)),
        }
    return {"chunk": length, "warm_up": warm_up, "piece": piece, **found}


def by_devices(folder: Path, size: tuple[int, int] = (128, 96)) -> dict[str, Any]:
    """Wall seconds of a real film by one and by two workers on the same device."""
    clip = write_clip(folder / "devices", 6 * CHUNK, size=size)
    seconds = {}
    for count in (1, 2):
        output = folder / f"devices-{count}" / "film.mp4"
        flags = RenderFlags(output=output, chunk=CHUNK, accumulate=2, device=DEVICE)
        start = time.monotonic()
        render(clip, flags=flags, cluster=f"local:{count}")
        seconds[count] = round(time.monotonic() - start, 2)
    return {"device": DEVICE, "size": size, "cores": os.cpu_count(), "seconds": seconds}


PARTS = {"workers": by_workers, "tasks": by_tasks, "start": of_start, "devices": by_devices}


def main() -> None:
    """Print the figures."""
    found: dict[str, Any] = {"iprt": iprt.__version__, "python": platform.python_version()}
    for name in sys.argv[1:] or PARTS:
        # Renders print the names of their films.
        with tempfile.TemporaryDirectory() as folder, redirect_stdout(sys.stderr):
            found[name] = PARTS[name](Path(folder))
            found[name]["load"] = [round(one, 1) for one in os.getloadavg()]
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
