"""What this machine offers iprt, what is missing, and the commands that install it."""

from __future__ import annotations

import os
import platform
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from typing import Any

import iprt
from iprt.device.icd import OVERRIDES, SYSTEM_VENDORS, intel_runtime
from iprt.device.install import (
    GL_PACKAGES,
    apt_command,
    intel_command,
    opencl_command,
    pip_command,
)
from iprt.device.probe import probe

Record = dict[str, Any]
CORE = (
    "av",
    "imageio",
    "jinja2",
    "moderngl",
    "networkx",
    "numpy",
    "OpenEXR",
    "pillow",
    "pydantic",
    "pyopencl",
    "rich",
    "scikit-image",
    "scipy",
    "tomlkit",
    "trimesh",
    "tyro",
)
LLVM_PACKAGE = "libllvm19"


def examine() -> Record:
    """Everything `iprt doctor` says, as plain data.

    Returns
    -------
    dict
        `ok`: iprt can render; `opencl`: `devices`, `chosen`, `reason`, `vendors`, or
        `error`; `opengl`: `renderer`, `vendor`, `version`, `software`, or `error`; `versions`:
        name -> version or None; `optional`: list of `name`, `purpose`, `version`, `state`;
        `missing`: list of `what`, `why`, `install`.
    """
    with ThreadPoolExecutor() as pool:
        opencl, opengl = pool.submit(probe, "opencl"), pool.submit(probe, "opengl")
        mitsuba = pool.submit(probe, "mitsuba") if _version("mitsuba") else None
        return diagnose(
            opencl.result() | {"vendors": vendors_folder()},
            opengl.result(),
            mitsuba.result() if mitsuba is not None else None,
            versions(),
        )


def diagnose(
    opencl: Record, opengl: Record, mitsuba: Record | None, found: dict[str, str | None]
) -> Record:
    """Put together the records of the probes, and derive from them what is missing."""
    optional = optional_parts(mitsuba)
    missing: list[Record] = []

    def lacks(what: str, why: str, install: str | None) -> None:
        if install is not None:
            missing.append({"what": what, "why": why, "install": install})

    devices = opencl.get("devices", [])
    if all(device["problem"] for device in devices):
        command = opencl_command(pocl_fails=bool(devices))
        lacks("OpenCL device", "nothing renders without one", command)
    if "error" in opengl and found["moderngl"]:
        lacks(
            "OpenGL through EGL",
            "it draws objects; rays do instead, and `trace.objects=raster` does not work",
            apt_command(*GL_PACKAGES),
        )
    for name in CORE:
        if found[name] is None:
            lacks(name, "iprt needs it", pip_command(name))
    for part in optional:
        lacks(part["name"], part["purpose"], part.pop("install"))
    return {
        "ok": not ("error" in opencl or any(found[n] is None for n in CORE)),
        "opencl": opencl,
        "opengl": opengl,
        "versions": found,
        "optional": optional,
        "missing": missing,
    }


def optional_parts(mitsuba: Record | None) -> list[Record]:
    """Parts that iprt does without: what each is for, whether it works, how to get it."""
    parts = [
        _package("flip-evaluator", "the FLIP column of `iprt compare`"),
        _package("mitsuba", "path-traced references"),
    ]
    if mitsuba is not None:
        parts.append(_llvm(mitsuba))
    parts.append(_package("pyoidn", "denoised references"))
    parts.append(_package("imgui-bundle", "`iprt view` in a window"))
    parts.append(_package("moderngl-window", "`iprt view` in a window"))
    parts.append(_package("viser", "`iprt view --web`"))
    intel = _package("intel-opencl-rt", "the fastest OpenCL driver for x86 processors")
    intel["install"] = None if intel_runtime() else intel_command()
    return [*parts, intel]


def _package(name: str, purpose: str) -> Record:
    version = _version(name)
    return {
        "name": name,
        "purpose": purpose,
        "version": version,
        "state": "installed" if version else "not installed",
        "install": None if version else pip_command(name),
    }


def _llvm(mitsuba: Record) -> Record:
    works = str(mitsuba.get("variant", "")).startswith("llvm")
    state = mitsuba.get("error") or f"Mitsuba runs {mitsuba['variant']}"
    return {
        "name": "LLVM >= 17",
        "purpose": "makes Mitsuba about ten times faster",
        "version": mitsuba.get("llvm"),
        "state": state,
        "install": None if works else apt_command(LLVM_PACKAGE),
    }


def vendors_folder() -> str:
    """Where the OpenCL loader looks for drivers."""
    return next(
        (os.environ[name] for name in OVERRIDES if os.environ.get(name)), str(SYSTEM_VENDORS)
    )


def versions() -> dict[str, str | None]:
    """Versions of the system, Python, iprt and what it is built on; None: not installed."""
    return {
        "system": platform.platform(),
        "python": f"{platform.python_version()} ({sys.executable})",
        "iprt": iprt.__version__,
        **{name: _version(name) for name in CORE},
    }


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
