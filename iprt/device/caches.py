"""Cache folders for compiled kernels, chosen before pyopencl is imported.

pyopencl, PoCL and Mesa store compiled kernels in the user's cache folder, `$XDG_CACHE_HOME` or
`~/.cache`. PoCL uses `$POCL_CACHE_DIR` where that is set. Without a writable folder, pyopencl
raises database errors and PoCL lists no device. On a full disk, PoCL's LLVM ends the process.
A temporary folder therefore replaces an unusable one.
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
"""Least free bytes of a cache folder: about eight times the size of a picture's kernels."""
KEPT = ("iprt", "pocl", "pyopencl", "pytools")
"""Subfolders of the user's cache folder that iprt and its libraries write to."""

LOG = logging.getLogger("iprt.device")


@dataclass(frozen=True)
class Caches:
    """Location of the compiled kernels.

    Attributes
    ----------
    folder : Path or None
        None: no folder can hold them.
    problem : str
        The reason why they will not last until the next run, with a remedy. Empty if they will.
    """

    folder: Path | None
    problem: str = ""


@cache
def settle_caches() -> Caches:
    """Point this process's environment variables at writable cache folders."""
    user = cache_folder()
    pocl = os.environ.get("POCL_CACHE_DIR")
    problems = {
        "XDG_CACHE_HOME": "there is no home folder" if user is None else user_problem(user),
        "POCL_CACHE_DIR": folder_problem(Path(pocl)) if pocl else "",
    }
    if user is not None and "XDG_CACHE_HOME" in os.environ:
        os.environ["XDG_CACHE_HOME"] = str(user)  # replaces a relative path, which is invalid
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
    """Check that compiled kernels can be stored; warn once if only for this run.

    Raises
    ------
    DeviceError
        No folder can hold them.
    """
    caches = settle_caches()
    if caches.folder is None:
        raise DeviceError(f"no folder can hold compiled kernels: {caches.problem}")
    if caches.problem:
        LOG.warning("compiled kernels are not kept for the next run: %s", caches.problem)


def cache_folder() -> Path | None:
    """Return `$XDG_CACHE_HOME` if absolute, else `~/.cache`; None for a user without a home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        base = os.path.expanduser("~/.cache")
    return Path(base) if os.path.isabs(base) else None


def own_folder() -> Path:
    """Return iprt's cache folder. Without a cache folder, the path is one that cannot be made."""
    return (cache_folder() or Path(os.devnull)) / "iprt"


def user_problem(user: Path) -> str:
    """Return the reason why a user's cache folder is unusable, as a clause; empty if usable."""
    existing = [user / name for name in KEPT if os.path.lexists(user / name)]
    return next(filter(None, map(folder_problem, [user, *existing])), "")


def folder_problem(folder: Path) -> str:
    """Return the reason why a folder cannot hold a cache, as a clause; empty if it can."""
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
    """Make a temporary folder for this process and remove it at exit."""
    folder = Path(tempfile.mkdtemp(prefix="iprt-"))

    def remove() -> None:
        shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    register(remove)
    return folder
