"""Python packages: what is missing, how to get it, and iprt itself from a checkout."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64")


def project() -> dict[str, object]:
    """The table `project` of pyproject.toml."""
    table: dict[str, object] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return table


def missing(requirements: list[str]) -> list[str]:
    """Those that are not installed or too old, and what installed ones require and lack.

    Requirements for some systems, Pythons and extras only (`; ...`) are not followed.
    """
    lacking: dict[str, str] = {}
    seen: set[str] = set()
    waiting = list(requirements)
    while waiting:
        wanted = waiting.pop()
        found = re.match(r"[\w.-]+", wanted)
        if ";" in wanted or found is None or wanted in seen:
            continue
        seen.add(wanted)
        name = found[0]
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            lacking[name] = wanted
            continue
        least = re.search(r">=\s*([\d.]+)", wanted)
        if least and _numbers(version) < _numbers(least[1]):
            lacking[name] = wanted
        waiting += metadata.requires(name) or []
    return sorted(lacking.values(), key=str.lower)


def advice(lacking: list[str]) -> str:
    """How to get them, with a network and without."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    names = " ".join(map(repr, lacking))
    there = " ".join(f"--platform {name}" for name in PLATFORMS)
    return (
        f"{sys.executable} -m pip install {names}; without a network, elsewhere: pip download "
        f"-d wheels --no-deps --only-binary=:all: --python-version {version} {there} {names}, "
        "and what these need"
    )


def install_here(folder: Path) -> None:
    """Metadata of iprt, as of an installed package, for what is started with `folder` in its path:
    methods are its entry points.
    """
    here = project()
    info = folder / "iprt-0.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: iprt\nVersion: 0\n")
    groups = here["entry-points"]
    assert isinstance(groups, dict)
    lines = []
    for group, points in groups.items():
        lines += [f"[{group}]", *(f"{name} = {target}" for name, target in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def _numbers(version: str) -> list[int]:
    return [int(digits) for digits in re.findall(r"\d+", version)]
