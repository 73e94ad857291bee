"""OpenGL without a window: an EGL context and the shaders of `glsl/`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import moderngl

from iprt.device.install import GL_PACKAGES, apt_command
from iprt.errors import DeviceError
from iprt.files.resources import GLSL

_REQUIRED_GL = 330
_INCLUDES = ("view.glsl", "mesh.glsl", "triangle.glsl", "depth.glsl")


def create_context() -> moderngl.Context:
    """Create an OpenGL 3.3 core context through EGL, without a display.

    Raises
    ------
    DeviceError
        EGL or OpenGL 3.3 is missing; the message names the Debian packages.
    """
    settings: dict[str, Any] = {"backend": "egl"}
    try:
        context = moderngl.create_context(require=_REQUIRED_GL, standalone=True, **settings)
    except Exception as error:  # glcontext and moderngl raise bare Exception and ValueError
        reason = " ".join(str(error).split())
        raise DeviceError(
            f"no OpenGL 3.3 context through EGL ({reason}): "
            f"install a driver with `{apt_command(*GL_PACKAGES)}`"
        ) from error
    for name in _INCLUDES:
        context.includes[name] = (GLSL / name).read_text(encoding="utf-8")
    return context


def load_program(
    context: moderngl.Context,
    fragment: str,
    *,
    vertex: str,
    geometry: str | None = None,
    defines: Mapping[str, int] | None = None,
) -> moderngl.Program:
    """Compile and link a program from files of `glsl/`.

    Parameters
    ----------
    fragment, vertex, geometry : str
        File names.
    defines : mapping, optional
        Preprocessor definitions that select a variant.
    """
    lines = "".join(f"#define {name} {value}\n" for name, value in (defines or {}).items())

    def source(name: str) -> str:
        text = (GLSL / name).read_text(encoding="utf-8")
        return text.replace("#version 330\n", f"#version 330\n{lines}", 1)

    return context.program(
        vertex_shader=source(vertex),
        geometry_shader=source(geometry) if geometry else None,
        fragment_shader=source(fragment),
    )


def set_uniforms(program: moderngl.Program, values: Mapping[str, Any]) -> None:
    """Set the uniforms that the program has; compilers remove unused ones."""
    for name, value in values.items():
        if name in program:
            uniform: Any = program[name]
            uniform.value = value


def bind_textures(program: moderngl.Program, textures: Mapping[str, moderngl.Texture]) -> None:
    """Bind `textures` to the program's samplers of the same names."""
    for unit, (name, texture) in enumerate(textures.items()):
        if name in program:
            sampler: Any = program[name]
            sampler.value = unit
            texture.use(unit)
