"""Tests on rusticl, Mesa's OpenCL, on a processor: `python -m tests.rusticl [FLAGS]`, for pytest.

Kernels reach it through SPIR-V and NIR, as they do Mesa's drivers of GPUs and those on top of
Vulkan. Debian's packages are unpacked into a folder, as they cannot be installed beside those that
`./run gpu` needs. By default what tells implementations apart: device functions, and pictures
against PoCL's.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "out/rusticl"
PACKAGE = "mesa-opencl-icd"
LIBRARY = "usr/lib/*/libRusticlOpenCL.so.1"
BUILTINS = Path("usr/lib/clc")
"""Where `spirv-mesa3d-.spv` and `spirv64-mesa3d-.spv` are, in the packages and for the library."""
TESTS = ("tests/kernels", "tests/frame/test_devices_agree.py")


class MissingError(Exception):
    """The driver is not available; the message says why, in one line."""


def unpacked() -> Path:
    """The driver's library, from `FOLDER`, else from the packages that hold what it needs.

    Raises
    ------
    MissingError
    """
    found = next(FOLDER.glob(LIBRARY), None)
    if found is None:
        FOLDER.parent.mkdir(exist_ok=True)
        with TemporaryDirectory(dir=FOLDER.parent) as name:
            os.chmod(name, 0o755)  # apt fetches as a user of its own
            _unpack(Path(name))
            shutil.rmtree(FOLDER, ignore_errors=True)
            shutil.copytree(name, FOLDER, symlinks=True)
        found = next(FOLDER.glob(LIBRARY))
    return found


def _unpack(folder: Path) -> None:
    """Fill a folder with the package and all that it needs and is not installed."""
    if not shutil.which("apt-get"):
        raise MissingError("there is no apt-get")
    wanted = _run("apt-get", "install", "--print-uris", "--reinstall", "-qq", PACKAGE)
    names = re.findall(r"^'\S+' ([^_\s]+)_", wanted, re.MULTILINE)
    if PACKAGE not in names:
        raise MissingError(f"this distribution has no {PACKAGE}")
    _run("apt-get", "download", "-qq", *names, folder=folder)
    for package in folder.glob("*.deb"):
        _run("dpkg-deb", "-x", str(package), str(folder))
        package.unlink()
    library = next(folder.glob(LIBRARY), None)
    if library is None:
        raise MissingError(f"{PACKAGE} of this distribution holds no rusticl")
    if not (folder / BUILTINS).is_dir():  # they are installed where the library looks for them
        return
    library = library.resolve()
    library.write_bytes(with_builtins_in(library.read_bytes(), FOLDER.relative_to(ROOT)))
    for file in (folder / BUILTINS).glob("spirv*-mesa3d-.spv"):
        file.rename(folder / file.name)
    shutil.rmtree(folder / BUILTINS)


def with_builtins_in(library: bytes, folder: Path) -> bytes:
    """The library, looking for its built-in functions in `folder` instead of the system's.

    The path is relative to the current folder and no longer than the one that it replaces, which
    is fixed in the library.
    """
    for file in re.findall(rf"/{BUILTINS}/(spirv\w*-mesa3d-\.spv)\0".encode(), library):
        old = f"/{BUILTINS}/".encode() + file + b"\0"
        new = f"{folder}/".encode() + file + b"\0"
        assert len(new) <= len(old)
        library = library.replace(old, new.ljust(len(old), b"\0"))
    return library


def _run(*command: str, folder: Path = ROOT) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        why = (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]
        raise MissingError(f"{' '.join(command[:2])}: {why}")
    return done.stdout


def environment(library: Path) -> dict[str, str]:
    """Return the environment with rusticl as the only driver, for processes that run in `ROOT`."""
    vendors = FOLDER / "vendors"
    vendors.mkdir(exist_ok=True)
    (vendors / "rusticl.icd").write_text(f"{library}\n")
    own, others = str(library.parent), os.environ.get("LD_LIBRARY_PATH")
    return {
        **os.environ,
        "OCL_ICD_VENDORS": str(vendors),
        "LD_LIBRARY_PATH": os.pathsep.join(filter(None, (own, others))),
        "RUSTICL_ENABLE": "llvmpipe",
        "IPRT_TEST_DEVICE": "rusticl",
    }


def main(flags: list[str]) -> int:
    """The command; its exit status."""
    try:
        library = unpacked()
    except MissingError as error:
        print(f"skipped: rusticl cannot be had here: {error}")
        return 0
    tests = [] if any(flag.startswith("tests") for flag in flags) else TESTS
    command = [sys.executable, "-m", "pytest", *flags, *tests]
    return subprocess.run(command, cwd=ROOT, env=environment(library), check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
