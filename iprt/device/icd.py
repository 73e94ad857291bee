"""Which OpenCL drivers the loader finds. Runs before pyopencl lists platforms for the first time.

pyopencl's wheel brings its own loader. It reads `/etc/OpenCL/vendors`, or the folder that
`OCL_ICD_VENDORS` names instead of it, and finds the PoCL wheel by itself. Two drivers it misses:

- Intel's CPU runtime from PyPI: its own ICD file names a path that exists nowhere.
- NVIDIA's driver in containers: the library is mounted, its ICD file often is not.

For these we write a vendors folder of our own, which also holds the system's entries.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import site
import sys
import sysconfig
import tempfile
from collections.abc import Mapping
from pathlib import Path

from iprt.device.caches import own_folder

SYSTEM_VENDORS = Path("/etc/OpenCL/vendors")
OVERRIDES = ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH")
INTEL = "libintelocl.so"
NVIDIA = "libnvidia-opencl.so.1"


def register_drivers() -> None:
    """Point `OCL_ICD_VENDORS` at our vendors folder, where the system's own would miss a driver.

    If the user set one of `OVERRIDES`, that choice stands.
    """
    if any(os.environ.get(name) for name in OVERRIDES):
        return
    system = read_vendors(SYSTEM_VENDORS)
    entries = vendor_entries(system, intel_runtime(), nvidia_library())
    if entries != system:
        with contextlib.suppress(OSError):  # where nothing can be written, the system's must do
            os.environ["OCL_ICD_VENDORS"] = str(write_vendors(entries, own_folder()))


def vendor_entries(
    system: Mapping[str, str], intel: Path | None, nvidia: str | None
) -> dict[str, str]:
    """The system's ICD files and those it lacks, as file name -> library.

    An entry of the system for Intel's runtime gives way to ours: two versions of that library
    in one process share their dependencies by name, and crash.
    """
    entries = dict(system)
    if intel is not None:
        entries = {name: library for name, library in system.items() if INTEL not in library}
        entries["iprt-intel.icd"] = str(intel)
    if nvidia is not None and not any("nvidia" in library for library in system.values()):
        entries["iprt-nvidia.icd"] = nvidia
    return entries


def read_vendors(folder: Path) -> dict[str, str]:
    """The ICD files of a vendors folder, as file name -> library; unreadable ones are left out."""
    entries = {}
    for file in sorted(folder.glob("*.icd")):
        with contextlib.suppress(OSError, UnicodeDecodeError):
            entries[file.name] = file.read_text(encoding="utf-8").strip()
    return entries


def write_vendors(entries: Mapping[str, str], cache: Path) -> Path:
    """A folder below `cache` that holds `entries`.

    The folder's name is a hash of what it holds, so that processes of different environments
    never write different things to one place.

    Raises
    ------
    OSError
        It cannot be written.
    """
    text = "\0".join(f"{name}\0{library}" for name, library in sorted(entries.items()))
    name = f"vendors-{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    return _fill(cache / name, entries)


def _fill(folder: Path, entries: Mapping[str, str]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    if read_vendors(folder) == dict(entries):
        return folder
    for name, library in entries.items():
        handle, temporary = tempfile.mkstemp(dir=folder, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(library + "\n")
        os.replace(temporary, folder / name)
    return folder


def intel_runtime() -> Path | None:
    """The library of Intel's CPU runtime, if pip (or conda) installed it where we run."""
    prefixes = (sysconfig.get_path("data"), sys.prefix, sys.base_prefix, site.getuserbase())
    for prefix in prefixes:
        library = Path(prefix) / "lib" / INTEL
        if os.path.isfile(library):  # False, too, in a folder that may not be searched
            return library
    return None


def nvidia_library() -> str | None:
    """NVIDIA's OpenCL library by its name, if the system can load it."""
    try:
        ctypes.CDLL(NVIDIA)
    except OSError:
        return None
    return NVIDIA
