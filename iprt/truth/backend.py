"""Mitsuba, an optional dependency, loaded with the variant that works on this machine.

Dr.Jit compiles its kernels with any LLVM it finds. An LLVM older than 17 may abort the process on a
kernel that it cannot compile. So the variant is tried in a child process first.
"""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from iprt.errors import DeviceError, IprtError

LOG = logging.getLogger("iprt.truth")
VECTOR, SCALAR = "llvm_ad_rgb", "scalar_rgb"
OLDEST_LLVM = 17
INSTALL_LLVM = f"install LLVM >= {OLDEST_LLVM} (Debian: apt-get install libllvm19)"
_LLVM_PLACES = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
)
_PROBE = """
import drjit as dr
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}})
ray = mi.Ray3f(mi.Point3f(mi.Float([0, 1]), 0, -3), mi.Vector3f(0, 0, 1))
distance = dr.maximum(scene.ray_intersect(ray).t, 0)  # LLVM 15 has no code for a maximum
assert distance.numpy()[0] == 2
"""


def require_reference() -> None:
    """Raise an error early if path tracing or denoising is unavailable.

    Raises
    ------
    IprtError
        Mitsuba or pyoidn is not installed.
    """
    for module in ("mitsuba", "pyoidn"):
        if find_spec(module) is None:
            raise IprtError(f"no module {module}: pip install 'iprt[reference]'")


@cache
def mitsuba() -> Any:
    """Return the `mitsuba` module with `llvm_ad_rgb` set, or `scalar_rgb` with a warning.

    Raises
    ------
    IprtError
        If Mitsuba is not installed.
    """
    llvm = _newest_llvm()
    if llvm is not None:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(llvm))
    try:
        import mitsuba as mi
    except ImportError as error:
        raise IprtError(
            f"the reference needs Mitsuba ({error}): pip install 'iprt[reference]'"
        ) from None
    probe = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, check=False)
    if probe.returncode == 0:
        mi.set_variant(VECTOR)
    else:
        LOG.warning(
            "Mitsuba's %s does not run here (%s): using %s, about ten times slower; %s",
            VECTOR,
            llvm or f"no LLVM >= {OLDEST_LLVM} found",
            SCALAR,
            INSTALL_LLVM,
        )
        mi.set_variant(SCALAR)
    return mi


def vector_mitsuba() -> Any:
    """Return the `mitsuba` module, for code that works on arrays of rays.

    Raises
    ------
    DeviceError
        If only the scalar variant works.
    """
    mi = mitsuba()
    if mi.variant() == SCALAR:
        raise DeviceError(f"this reference needs Mitsuba's {VECTOR}: {INSTALL_LLVM}")
    return mi


def _newest_llvm() -> Path | None:
    found: list[tuple[int, Path]] = []
    for pattern in _LLVM_PLACES:
        for path in Path("/").glob(pattern.removeprefix("/")):
            version = re.search(r"libLLVM[.-](?:so\.)?(\d+)|llvm-(\d+)", str(path))
            if version is not None:
                found.append((int(version[1] or version[2]), path))
    usable = [candidate for candidate in found if candidate[0] >= OLDEST_LLVM]
    return max(usable)[1] if usable else None
