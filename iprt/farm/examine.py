"""Examination of a worker before it renders: versions, folders, space and its device.

It runs in a process of its own, `python -m iprt.farm.examine ORDER TOKEN`, because drivers can end
the process that calls them.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import uuid
from dataclasses import asdict
from pathlib import Path
from typing import Any

from iprt.farm.order import Order
from iprt.files.message_text import printable

TIMEOUT_S = 120.0


def examine(order: Order, token: str) -> dict[str, str]:
    """Examine this worker.

    Parameters
    ----------
    token : str
        Name of a file that the client has written to the folder of parts.

    Returns
    -------
    dict
        `problem`, or else `device` and `mark`, the name of a file that the worker has written to
        the folder of parts.
    """
    from iprt.farm.task import environment

    command = [sys.executable, "-P", "-m", "iprt.farm.examine", json.dumps(asdict(order)), token]
    try:
        child = subprocess.run(
            command,
            env=environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIMEOUT_S,
            check=False,
        )
        found: dict[str, str] = json.loads(child.stdout)
    except (OSError, subprocess.TimeoutExpired) as error:
        return {"problem": f"no process can be started: {printable(str(error))}"}
    except ValueError:
        last = (child.stderr.strip().splitlines() or [f"exit status {child.returncode}"])[-1]
        return {"problem": f"iprt cannot be started: {printable(last)}"}
    return found


def findings(order: Order, token: str) -> dict[str, str]:
    """Return what `examine` returns, found in this process."""
    from iprt.errors import IprtError

    try:
        _require_same(order)
        mark = _require_shared(order, token)
        _require_scene(order)
        return {"device": _device(order), "mark": mark}
    except IprtError as error:
        return {"problem": printable(str(error), 600)}


def _require_same(order: Order) -> None:
    import iprt
    from iprt.errors import IprtError

    if iprt.__version__ != order.version:
        raise IprtError(
            f"has iprt {iprt.__version__}, and {order.version} is asked for; install iprt "
            f"{order.version} there"
        )


def _require_shared(order: Order, token: str) -> str:
    """Refuse a folder of parts that is another one than the client's; write a mark into it."""
    from iprt.errors import FormatError
    from iprt.files.atomic import replacing

    parts = Path(order.parts)
    if not (parts / token).exists():
        raise FormatError(
            f"{parts}: is not the folder that it is here; mount the same storage at the same path"
        )
    mark = parts / f"{token}.{uuid.uuid4().hex}"
    with replacing(mark) as temporary:
        temporary.write_text("seen", "utf-8")
    free = shutil.disk_usage(parts).free
    if free < order.space:
        raise FormatError(
            f"{parts}: has {free >> 20} MiB free; the chunks under way need about "
            f"{order.space >> 20} MiB: make room, or name another output"
        )
    return mark.name


def _require_scene(order: Order) -> None:
    from iprt.errors import FormatError, IprtError
    from iprt.scene.scene import Scene
    from iprt.scene.scene_files import fingerprint

    try:
        scene = Scene.open(Path(order.scene), allow_outside=order.allow_outside)
        found = fingerprint(scene)
    except IprtError as error:
        raise FormatError(f"{error}; mount the scene's folder at the same path") from error
    if found != order.fingerprint:
        raise FormatError(
            f"{order.scene}: holds other files than here, by size or time; share one folder, or "
            "copy it with its times (rsync -a)"
        )


def _device(order: Order) -> str:
    from iprt.device.choose import choose

    info = choose(order.device).info
    return f"{info.name} ({info.platform})"


def main() -> None:
    """Print the findings as JSON."""
    values: dict[str, Any] = json.loads(sys.argv[1])
    order = Order(**{**values, "words": tuple(values["words"])})
    print(json.dumps(findings(order, sys.argv[2])))


if __name__ == "__main__":
    main()
