"""Connection to a dask cluster: one of this machine, or one that runs elsewhere."""

from __future__ import annotations

import json
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from iprt.errors import IprtError
from iprt.farm.order import RESOURCE
from iprt.files.message_text import printable

if TYPE_CHECKING:
    from distributed import Client

CONNECT_S = 15.0
"""Longest wait for a scheduler."""
MOST_LOCAL = 64
HOST, QUIET = "127.0.0.1", "127.0.0.1:0"
"""Addresses of the cluster of this machine, and of its pages on any free port."""
LOCAL = re.compile(r"local(?::(.*))?")
CONFIG: dict[str, Any] = {
    "distributed.scheduler.work-stealing": False,
    # Renders have their threads from their own drivers.
    "distributed.nanny.pre-spawn-environ": {},
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": False,
    "distributed.admin.tick.limit": "1h",
    "logging": {"distributed": "critical", "distributed.client": "critical"},
}


def require_dask() -> None:
    """Raise an error if dask is missing.

    Raises
    ------
    IprtError
    """
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise IprtError(
            f"--cluster needs dask.distributed ({error}): pip install 'iprt[cluster]'"
        ) from error


def scheduler_address(where: str) -> str | None:
    """Return the address of the scheduler that `--cluster` names; None: workers of this machine.

    Raises
    ------
    IprtError
        It names no cluster, or the number of workers is none.
    """
    found = LOCAL.fullmatch(where)
    if found is not None:
        text = found[1]
        if text is None or (text.isascii() and text.isdigit() and 1 <= int(text) <= MOST_LOCAL):
            return None
        raise IprtError(f"--cluster {where}: expected 1 to {MOST_LOCAL} workers, such as local:2")
    if re.match(r"[a-z]+://.", where):
        return where
    file = Path(where)
    if not file.is_file():
        raise IprtError(
            f"--cluster {where}: expected local, local:2, the address of a scheduler such as "
            "tcp://host:8786, or its scheduler file; there is no such file"
        )
    try:
        return str(json.loads(file.read_text("utf-8"))["address"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise IprtError(
            f"--cluster {file}: is not a scheduler file of dask; write one: dask scheduler "
            f"--scheduler-file {file}"
        ) from error


def local_devices(where: str, device: str | None) -> list[str]:
    """Return the place of the OpenCL device of each worker of this machine.

    They are those like the best one, so that all pictures are equal; or the one that is named.

    Parameters
    ----------
    where : str
        `local`, or `local:` and the number of workers.

    Raises
    ------
    DeviceError
    """
    from iprt.device.choose import choose, describe_devices

    chosen = choose(device).info
    alike = [
        info.index
        for info in describe_devices()
        if (info.name, info.platform, info.driver, info.problem)
        == (chosen.name, chosen.platform, chosen.driver, "")
    ]
    named = device is not None and re.fullmatch(r"\d+:\d+", device)
    places = [chosen.index] if named or not alike else alike
    count = int(where.partition(":")[2] or len(places))
    return [places[n % len(places)] for n in range(count)]


@contextmanager
def connected(address: str | None, devices: list[str]) -> Iterator[Client]:
    """Connect to a scheduler, or start one on this machine with a worker for each device.

    Raises
    ------
    IprtError
        No scheduler answers.
    """
    require_dask()
    import dask
    from distributed import Client
    from distributed.versions import VersionMismatchWarning

    for name in ("distributed", "distributed.client", "asyncio", "tornado"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    warnings.filterwarnings("ignore", category=VersionMismatchWarning)
    if address is None:
        with dask.config.set(CONFIG), _local(devices) as cluster, Client(cluster) as client:
            yield client
        return
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise IprtError(
            f"--cluster: no scheduler answers at {address}; start one: dask scheduler "
            f"({printable(str(error))})"
        ) from error
    try:
        yield client
    finally:
        with suppress(Exception):  # the scheduler may be gone
            client.close(timeout=5.0)


@contextmanager
def _local(devices: list[str]) -> Iterator[Any]:
    from distributed import Nanny, Scheduler, SpecCluster

    from iprt.device.choose import VARIABLE

    def worker(place: str) -> dict[str, Any]:
        options = {
            "nthreads": 1,
            "resources": {RESOURCE: 1},
            "env": {VARIABLE: place},
            "host": HOST,
            "dashboard_address": QUIET,
            "silence_logs": logging.CRITICAL,
        }
        return {"cls": Nanny, "options": options}

    cluster = SpecCluster(
        workers={number: worker(place) for number, place in enumerate(devices)},
        scheduler={"cls": Scheduler, "options": {"dashboard_address": QUIET, "host": HOST}},
        silence_logs=logging.CRITICAL,
    )
    try:
        yield cluster
    finally:
        with suppress(TimeoutError):
            cluster.close(timeout=10.0)
