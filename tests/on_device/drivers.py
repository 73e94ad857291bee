"""Registration of GPU drivers that are somewhere on the machine.

The environment names them for processes that are started later: the loaders of OpenCL and OpenGL
read it once, before they load any driver.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from importlib.metadata import entry_points
from pathlib import Path

from iprt.commands.probe import Record, probe
from iprt.device.icd import OVERRIDES, SYSTEM_VENDORS, read_vendors, write_vendors
from tests.on_device.conftest import ROOT

LIBRARIES = {"nvidia": "libnvidia-opencl.so", "amd": "libamdocl64.so", "intel": "libigdrcl.so"}
"""OpenCL drivers of GPUs, by vendor."""
FOLDERS = (
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib64",
    "/usr/lib/x86_64-linux-gnu/nvidia/current",
    "/usr/local/nvidia/lib64",
    "/usr/local/nvidia/lib",
    "/usr/lib/wsl/lib",
    "/opt/rocm/lib",
    "/opt/rocm/opencl/lib",
    "/usr/lib/x86_64-linux-gnu/intel-opencl",
)
EGL_VENDORS = ("/usr/share/glvnd/egl_vendor.d", "/usr/local/nvidia/share/glvnd/egl_vendor.d")
EGL = "__EGL_VENDOR_LIBRARY_FILENAMES"
NVIDIA_VERSION = Path("/proc/driver/nvidia/version")


def install_here(folder: Path) -> None:
    """Make processes find this checkout's methods, which are entry points, if it is not installed.

    `folder` takes the metadata of a package.
    """
    if entry_points(group="iprt.methods"):
        return
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    lines = []
    for group, points in groups.items():
        lines += [f"[{group}]", *(f"{name} = {target}" for name, target in points.items())]
    info = folder / "iprt-0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: iprt\nVersion: 0\n")
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    sys.path.append(str(folder))
    path = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [path, str(folder)]))


def find_opencl(folder: Path, *, needs_gpu: bool) -> Record:
    """Find OpenCL devices; register drivers of GPUs in `folder` if the loader knows none."""
    found = probe("opencl")
    if needs_gpu and not _gpus(found):
        libraries = libraries_in(library_folders())
        for library in libraries.values():
            print(f"OpenCL: {library} is not registered; it is now, for this run")
        if libraries:
            register(libraries, folder)
            found = probe("opencl")
    for device in found.get("devices", []):
        print(f"OpenCL: {device['index']} {device['name']} ({device['platform']})")
    if "error" in found:
        print(f"OpenCL: {found['error']}")
    if needs_gpu and not _gpus(found):
        print(missing_gpu())
    return found


def libraries_in(folders: Iterable[Path]) -> dict[str, Path]:
    """Find drivers of GPUs by vendor: the first of each, by its shortest name."""
    found: dict[str, Path] = {}
    for folder in folders:
        for vendor, name in LIBRARIES.items():
            files = sorted(folder.glob(f"{name}*"), key=lambda file: (len(file.name), file.name))
            if files:
                found.setdefault(vendor, files[0])
    return found


def library_folders() -> list[Path]:
    """List folders of libraries: of the system's loader, and usual ones."""
    named = os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep)
    known = _output("ldconfig", "-p") or _output("/sbin/ldconfig", "-p")
    listed = [line.rpartition("=> ")[2] for line in known.splitlines() if "=> " in line]
    names = [*filter(None, named), *map(os.path.dirname, listed), *FOLDERS]
    return [Path(name) for name in dict.fromkeys(names) if os.path.isdir(name)]


def register(libraries: dict[str, Path], folder: Path) -> None:
    """Add drivers to those that the OpenCL loader finds, in a vendors folder below `folder`."""
    used = next((os.environ[name] for name in OVERRIDES if os.environ.get(name)), None)
    entries = read_vendors(SYSTEM_VENDORS if used is None else Path(used))
    entries |= {f"found-{vendor}.icd": str(library) for vendor, library in libraries.items()}
    os.environ["OCL_ICD_VENDORS"] = str(write_vendors(entries, folder.resolve()))
    # A driver loads its compiler by name.
    beside = [str(library.parent) for library in libraries.values()]
    old = os.environ.get("LD_LIBRARY_PATH", "")
    os.environ["LD_LIBRARY_PATH"] = os.pathsep.join(filter(None, [old, *dict.fromkeys(beside)]))


def missing_gpu() -> str:
    """Say in one line why there may be no GPU."""
    if not NVIDIA_VERSION.exists():
        return "no GPU: there is no OpenCL driver of one, and no kernel module of NVIDIA"
    version = NVIDIA_VERSION.read_text().splitlines()[0]
    return (
        f"no GPU: the kernel has NVIDIA's driver ({version}), and {LIBRARIES['nvidia']}.1 is "
        "missing or fails; the package libnvidia-compute of just that version holds it, and what "
        "it loads (libnvidia-nvvm.so.4)"
    )


def find_egl() -> None:
    """Print the renderer of OpenGL through EGL, by NVIDIA's own library if it is not registered."""
    found = probe("opengl")
    if "error" in found or found.get("software"):
        files = [file for name in EGL_VENDORS for file in Path(name).glob("*nvidia*.json")]
        if files and EGL not in os.environ:
            os.environ[EGL] = str(files[-1])
            mended = probe("opengl")
            if "error" in mended:
                del os.environ[EGL]
            else:
                found = mended
    if "error" in found:
        print(f"EGL: {found['error']}")
    else:
        print(f"EGL: {found['found']}")


def describe_gpu() -> None:
    """Print clocks and power by `nvidia-smi`, if there is one."""
    wanted = "name,driver_version,clocks.sm,clocks.max.sm,clocks.mem,power.limit,pcie.link.gen.max"
    told = _output("nvidia-smi", f"--query-gpu={wanted}", "--format=csv,noheader")
    if told:
        print(f"nvidia-smi: {wanted}: {told.strip()}")


def _gpus(found: Record) -> list[Record]:
    return [device for device in found.get("devices", []) if device["kind"] == "gpu"]


def _output(*command: str) -> str:
    """Return the output of a command; nothing if it fails or hangs."""
    if shutil.which(command[0]) is None:
        return ""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""
