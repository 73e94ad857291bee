"""Where compiled kernels are kept between runs; settled before pyopencl is imported.

pyopencl, PoCL and Mesa keep what they compile in the user's cache folder, `$XDG_CACHE_HOME` or
`~/.cache`; PoCL in `$POCL_CACHE_DIR` where that is set. Without a folder that can be written,
pyopencl raises errors of its database, and PoCL lists no device; on a full disk, PoCL's LLVM ends
the process. So a temporary folder takes the place of one that is of no use.
"""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from iprt.device.budget import amount
from iprt.errors import DeviceError
from iprt.files.termination import register

NEEDED = 32 * 2**20
"""Free bytes: about eight times what the kernels of a picture take."""
KEPT = ("iprt", "pocl", "pyopencl", "pytools")
"""Folders of ours and of libraries in the user's cache folder."""

LOG = logging.getLogger("iprt.device")


@dataclass(frozen=True)
class Caches:
    """Where compiled kernels are kept.

    Attributes
    ----------
    folder : Path or None
        None: no folder can hold them.
    problem : str
        Why they are not kept for the next run, and what to do; empty if they are.
    """

    folder: Path | None
    problem: str = ""


@cache
def settle_caches() -> Caches:
    """Point the environment of this process at folders that compiled kernels can be written to."""
    user = cache_folder()
    pocl = os.environ.get("POCL_CACHE_DIR")
    problems = {
        "XDG_CACHE_HOME": "there is no home folder" if user is None else user_problem(user),
        "POCL_CACHE_DIR": folder_problem(Path(pocl)) if pocl else "",
    }
    if user is not None and "XDG_CACHE_HOME" in os.environ:
        os.environ["XDG_CACHE_HOME"] = str(user)  # a relative path means nothing
    wrong = {name: problem for name, problem in problems.items() if problem}
    if not wrong:
        return Caches(user)
    told = "; ".join([*wrong.values(), f"set {' and '.join(wrong)} to a folder with room"])
    try:
        temporary = _temporary()
    except OSError as error:
        return Caches(None, f"{error.strerror}; {told}")
    if problem := folder_problem(temporary):
        return Caches(None, f"{problem}; {told}")
    os.environ.update({name: str(temporary / name.lower()) for name in wrong})
    return Caches(temporary, told)


@cache
def require_caches() -> None:
    """Say once if compiled kernels are not kept.

    Raises
    ------
    DeviceError
        They cannot be written at all.
    """
    caches = settle_caches()
    if caches.folder is None:
        raise DeviceError(f"no folder can hold compiled kernels: {caches.problem}")
    if caches.problem:
        LOG.warning("compiled kernels are not kept for the next run: %s", caches.problem)


def cache_folder() -> Path | None:
    """`$XDG_CACHE_HOME` if that is absolute, else `~/.cache`; None for a user without a home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        base = os.path.expanduser("~/.cache")
    return Path(base) if os.path.isabs(base) else None


def own_folder() -> Path:
    """Ours in the cache folder; one that cannot be made where there is none."""
    return (cache_folder() or Path(os.devnull)) / "iprt"


def user_problem(user: Path) -> str:
    """Why a user's cache folder is of no use, as a clause; empty if it is of use."""
    existing = [user / name for name in KEPT if os.path.lexists(user / name)]
    return next(filter(None, map(folder_problem, [user, *existing])), "")


def folder_problem(folder: Path) -> str:
    """Why nothing can be kept in a folder, as a clause; empty if it can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        free = shutil.disk_usage(folder).free
        read_only = [file for file in folder.glob("*.sqlite") if not os.access(file, os.W_OK)]
    except OSError as error:
        return f"{folder} cannot be written ({error.strerror})"
    if read_only:
        return f"{read_only[0]} cannot be written"
    return f"{folder} is on a disk with {amount(free)} free" if free < NEEDED else ""


@cache
def _temporary() -> Path:
    """One folder for this process, which is removed at its end."""
    folder = Path(tempfile.mkdtemp(prefix="iprt-"))

    def remove() -> None:
        shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    register(remove)
    return folder
