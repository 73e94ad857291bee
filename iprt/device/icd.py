"""Registration of OpenCL drivers, before pyopencl lists platforms for the first time.

pyopencl's wheel brings its own loader. It reads `/etc/OpenCL/vendors`, or the folder that
`OCL_ICD_VENDORS` names instead, and finds the PoCL wheel by itself. It misses two drivers:

- Intel's CPU runtime from PyPI: its own ICD file names a path that exists nowhere.
- NVIDIA's driver in containers: the library is mounted, its ICD file often is not.

iprt writes a vendors folder with these, which also holds the system's entries.
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
    """Point `OCL_ICD_VENDORS` at iprt's vendors folder if the system's one misses a driver.

    Does nothing if the user has set one of `OVERRIDES`.
    """
    if any(os.environ.get(name) for name in OVERRIDES):
        return
    system = read_vendors(SYSTEM_VENDORS)
    entries = vendor_entries(system, intel_runtime(), nvidia_library())
    if entries != system:
        with contextlib.suppress(OSError):  # without a writable folder, use the system's
            os.environ["OCL_ICD_VENDORS"] = str(write_vendors(entries, own_folder()))


def vendor_entries(
    system: Mapping[str, str], intel: Path | None, nvidia: str | None
) -> dict[str, str]:
    """Return the system's ICD files plus the missing ones, as file name -> library.

    The entry for pip's Intel runtime replaces the system's: two versions of that library in one
    process share their dependencies by name, and crash.
    """
    entries = dict(system)
    if intel is not None:
        entries = {name: library for name, library in system.items() if INTEL not in library}
        entries["iprt-intel.icd"] = str(intel)
    if nvidia is not None and not any("nvidia" in library for library in system.values()):
        entries["iprt-nvidia.icd"] = nvidia
    return entries


def read_vendors(folder: Path) -> dict[str, str]:
    """Read the ICD files of a vendors folder, as file name -> library. Skip unreadable ones."""
    entries = {}
    for file in sorted(folder.glob("*.icd")):
        with contextlib.suppress(OSError, UnicodeDecodeError):
            entries[file.name] = file.read_text(encoding="utf-8").strip()
    return entries


def write_vendors(entries: Mapping[str, str], cache: Path) -> Path:
    """Write `entries` to a folder below `cache` and return its path.

    The folder's name is a hash of its contents, so that processes of different environments never
    write different entries to one folder.

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
    """Find the library of Intel's CPU runtime, as installed by pip or conda."""
    prefixes = (sysconfig.get_path("data"), sys.prefix, sys.base_prefix, site.getuserbase())
    for prefix in prefixes:
        library = Path(prefix) / "lib" / INTEL
        if os.path.isfile(library):  # also False in a folder without search permission
            return library
    return None


def nvidia_library() -> str | None:
    """Return the name of NVIDIA's OpenCL library if the system can load it."""
    try:
        ctypes.CDLL(NVIDIA)
    except OSError:
        return None
    return NVIDIA
