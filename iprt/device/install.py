"""Commands that install missing packages."""

from __future__ import annotations

import os
import platform
import re
import shlex
import shutil
import sys
from importlib import metadata

GL_PACKAGES = ("libegl1", "libgl1", "libgl1-mesa-dri")


def apt_command(*packages: str) -> str:
    """Return the command for Debian and Ubuntu, with `sudo` for users other than root."""
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    return f"{'' if root else 'sudo '}apt-get install -y {' '.join(packages)}"


def pip_command(*features: str) -> str:
    """Return the pip command for the running Python environment."""
    return shlex.join([sys.executable, "-m", "pip", "install", *features])


def requirements(extra: str = "") -> dict[str, str]:
    """Return the requirements of iprt, or of one of its extras: pip specifiers by name."""
    found = {}
    for text in metadata.requires("iprt") or ():
        wanted, _, marker = text.partition(";")
        name = re.match(r"[\w.-]+", wanted)
        of = re.search(r"extra == ['\"](.+?)['\"]", marker)
        if name is not None and (of[1] if of else "") == extra:
            found[name[0]] = wanted.strip()
    return found


def installed(name: str) -> str | None:
    """Return the version of a package, or None if it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def opencl_command(*, pocl_fails: bool = False) -> str:
    """Return the command that installs an OpenCL driver for the CPU.

    Debian's PoCL is two to three times as fast as PyPI's.

    Parameters
    ----------
    pocl_fails : bool, optional
        PoCL is installed already, but does not support this processor.
    """
    if shutil.which("apt-get") and not pocl_fails:
        return apt_command("pocl-opencl-icd")
    return intel_command() or pip_command("pyopencl[pocl]")


def intel_command() -> str | None:
    """Return the command for Intel's OpenCL runtime, or None: it exists for x86-64 only."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return None
    return pip_command("intel-opencl-rt", "intel-cmplr-lib-rt")
