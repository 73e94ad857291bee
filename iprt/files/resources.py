"""Locations of the OpenCL kernels (`cl/`) and shaders (`glsl/`), in a checkout and in a wheel."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _folder(name: str) -> Path:
    packaged = _PACKAGE / f"_{name}"
    return packaged if packaged.is_dir() else _PACKAGE.parent / name


CL = _folder("cl")
GLSL = _folder("glsl")
