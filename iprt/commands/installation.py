"""Drivers and packages on this machine, and the commands that install missing ones."""

from __future__ import annotations

import os
import platform
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import iprt
from iprt.commands.probe import probe
from iprt.device.caches import settle_caches
from iprt.device.icd import OVERRIDES, SYSTEM_VENDORS, intel_runtime, read_vendors
from iprt.device.install import (
    GL_PACKAGES,
    apt_command,
    intel_command,
    opencl_command,
    pip_command,
)

Record = dict[str, Any]
CORE = (
    "av",
    "imageio",
    "jinja2",
    "matplotlib",
    "moderngl",
    "networkx",
    "numpy",
    "OpenEXR",
    "pillow",
    "platformdirs",
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
        `error` and `alone` (`drivers_alone`); `opengl`: `renderer`, `vendor`, `version`,
        `software`, or `error`; `caches`: `folder` of compiled kernels and the `problem` with it;
        `versions`: name -> version or None; `optional`: list of `name`, `purpose`, `version`,
        `state`; `missing`: list of `what`, `why`, `install`.
    """
    names = ["opencl", "opengl", "window", "browser", *(["mitsuba"] if _version("mitsuba") else [])]
    with ThreadPoolExecutor() as pool:
        records = dict(zip(names, pool.map(probe, names), strict=True))
    records["opencl"]["vendors"] = vendors_folder()
    if "devices" not in records["opencl"]:
        records["opencl"]["alone"] = drivers_alone(Path(vendors_folder()))
    caches = settle_caches()
    folder = None if caches.folder is None else str(caches.folder)
    return diagnose(records, versions()) | {"caches": {"folder": folder, "problem": caches.problem}}


def drivers_alone(vendors: Path) -> dict[str, Record]:
    """The `devices` of each driver of a vendors folder, or an `error`, by the driver's library.

    Each is loaded by a process without the others: one that crashes, or two that clash, end a
    process that loads all.
    """

    def alone(entry: tuple[str, str]) -> Record:
        with TemporaryDirectory() as folder:
            Path(folder, entry[0]).write_text(f"{entry[1]}\n", encoding="utf-8")
            record = probe("opencl", variables={OVERRIDES[0]: folder, OVERRIDES[1]: ""})
        if "devices" in record:
            return {"devices": [device["name"] for device in record["devices"]]}
        return {"error": record["error"].partition(": install")[0]}

    entries = read_vendors(vendors)
    with ThreadPoolExecutor() as pool:
        return dict(zip(entries.values(), pool.map(alone, entries.items()), strict=True))


def diagnose(records: dict[str, Record], found: dict[str, str | None]) -> Record:
    """Put together the records of the probes by name, and derive from them what is missing."""
    opencl, opengl = records["opencl"], records["opengl"]
    optional = optional_parts(records)
    missing: list[Record] = []

    def lacks(what: str, why: str, install: str | None) -> None:
        if install is not None:
            missing.append({"what": what, "why": why, "install": install})

    devices = opencl.get("devices", [])
    some_alone = any("devices" in record for record in opencl.get("alone", {}).values())
    if all(device["problem"] for device in devices) and not some_alone:
        command = opencl_command(pocl_fails=bool(devices))
        lacks("OpenCL device", "nothing renders without one", command)
    if "error" in opengl and found["moderngl"]:
        lacks(
            "OpenGL through EGL",
            "objects are found by rays instead, and `--method iprt2023` does not work",
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


def optional_parts(records: dict[str, Record]) -> list[Record]:
    """Parts that iprt does without: what each is for, whether it works, how to get it."""
    mitsuba = records.get("mitsuba")
    parts = [
        _package("flip-evaluator", "the FLIP column of `iprt compare`"),
        _package("mitsuba", "path-traced references"),
    ]
    if mitsuba is not None:
        parts.append(_llvm(mitsuba))
    parts.append(_package("pyoidn", "denoised references"))
    parts.append(_viewer("iprt view", "imgui-bundle", "the viewer in a window", records["window"]))
    parts.append(_viewer("iprt view --web", "viser", "the viewer in a browser", records["browser"]))
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


def _viewer(command: str, package: str, purpose: str, record: Record) -> Record:
    return {
        "name": command,
        "purpose": purpose,
        "version": _version(package),
        "state": record.get("error", "works"),
        "install": record.get("install"),
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
