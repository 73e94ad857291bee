"""Drivers and packages on this machine, and the commands that install missing ones."""

from __future__ import annotations

import os
import platform
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import iprt
from iprt.commands.probe import Record, probe
from iprt.device.caches import settle_caches
from iprt.device.icd import OVERRIDES, SYSTEM_VENDORS, intel_runtime, read_vendors
from iprt.device.install import installed, intel_command, pip_command, requirements

PROBED = {
    "opengl": ("OpenGL through EGL", "draws objects for `--method iprt2023`, and on GPUs"),
    "window": ("iprt view", "the viewer in a window"),
    "browser": ("iprt view --web", "the viewer in a browser"),
    "mitsuba": ("Mitsuba", "path-traced references"),
}
"""Name and purpose of each optional part, by its probe."""
PACKAGES = {
    "pyoidn": "denoised references",
    "flip-evaluator": "the FLIP column of `iprt compare`",
    "usd-core": "USD files as meshes, and `iprt export`",
}


def examine() -> Record:
    """Return the findings of `iprt doctor` as plain data.

    Returns
    -------
    dict
        `ok`: iprt can render; `opencl`: `devices`, `chosen`, `reason`, `vendors`, or `error` and
        `alone` (`drivers_alone`); `caches`: `folder` of compiled kernels and the `problem` with it;
        `versions`: by name; `parts`: list of `name`, `purpose` and either `found` (such as a
        version) or an `error` with the command that installs it.
    """
    names = ("opencl", *PROBED)
    with ThreadPoolExecutor() as pool:
        records = dict(zip(names, pool.map(probe, names), strict=True))
    opencl = records["opencl"] | {"vendors": str(vendors_folder())}
    if "devices" not in opencl:
        opencl["alone"] = drivers_alone(vendors_folder())
    versions = {name: installed(name) for name in requirements()}
    caches = settle_caches()
    return {
        "ok": "error" not in opencl and None not in versions.values(),
        "opencl": opencl,
        "caches": {"folder": str(caches.folder or ""), "problem": caches.problem},
        "versions": {
            "system": platform.platform(),
            "python": f"{platform.python_version()} ({sys.executable})",
            "iprt": iprt.__version__,
            **versions,
        },
        "parts": parts(records),
    }


def parts(records: dict[str, Record]) -> list[Record]:
    """Return the state of each part that iprt uses, given the records of the probes by name."""
    found = [
        {"name": name, "purpose": purpose, **records[key]}
        for key, (name, purpose) in PROBED.items()
    ]
    for name, purpose in PACKAGES.items():
        version = installed(name)
        state = {"found": version} if version else _not_installed(pip_command(name))
        found.append({"name": name, "purpose": purpose, **state})
    for name, wanted in requirements().items():
        if not installed(name):
            lack = _not_installed(pip_command(wanted))
            found.append({"name": name, "purpose": "iprt needs it", **lack})
    command = intel_command()
    if command and not intel_runtime():
        purpose = "the fastest OpenCL driver for x86 processors"
        found.append({"name": "intel-opencl-rt", "purpose": purpose, **_not_installed(command)})
    return found


def _not_installed(command: str) -> Record:
    return {"error": f"not installed; `{command}`"}


def drivers_alone(vendors: Path) -> dict[str, str]:
    """Return the devices or the error of each driver of a vendors folder, by its library.

    Each driver is loaded by a process of its own: a driver that crashes, or two that clash, would
    end a process that loads all.
    """

    def alone(entry: tuple[str, str]) -> str:
        with TemporaryDirectory() as folder:
            Path(folder, entry[0]).write_text(f"{entry[1]}\n", encoding="utf-8")
            record = probe("opencl", {OVERRIDES[0]: folder, OVERRIDES[1]: ""})
        if "devices" in record:
            return ", ".join(device["name"] for device in record["devices"])
        return str(record["error"]).partition(": install")[0]

    entries = read_vendors(vendors)
    with ThreadPoolExecutor() as pool:
        return dict(zip(entries.values(), pool.map(alone, entries.items()), strict=True))


def vendors_folder() -> Path:
    """Return the folder where the OpenCL loader looks for drivers."""
    named = (os.environ[name] for name in OVERRIDES if os.environ.get(name))
    return Path(next(named, SYSTEM_VENDORS))
