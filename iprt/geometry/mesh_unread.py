"""Contents of mesh files that are not read, a phrase each, except for materials."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from iprt.files.toml_text import printable
from iprt.geometry.gltf_check import Gltf

_TRIANGLE_MODES = (4, 5)
_REPEAT = 10497
_OBJ_WORDS = {
    "l": "lines",
    "p": "points",
    "curv": "curves",
    "surf": "curved surfaces",
    "s": "smoothing groups",
}
_PLY_ELEMENTS = ("vertex", "face")


def unread_gltf(gltf: Gltf, *, animated: bool) -> Iterator[str]:
    """`animated`: an animation, and what bends with it, is read."""
    for key in ("cameras",) if animated else ("animations", "skins", "cameras"):
        if count := len(getattr(gltf, key)):
            yield f"{key} ({count})"
    primitives = [primitive for mesh in gltf.meshes for primitive in mesh.primitives]
    if any(primitive.mode not in _TRIANGLE_MODES for primitive in primitives):
        yield "points, lines or triangle fans"
    if any(primitive.targets for primitive in primitives):
        yield "morph targets"
    textures = [
        pbr.base_color_texture
        for material in gltf.materials
        if (pbr := material.pbr_metallic_roughness) is not None
        and pbr.base_color_texture is not None
    ]
    if any(texture.tex_coord for texture in textures):
        yield "a second set of texture coordinates; the first is used"
    samplers = [gltf.textures[texture.index].sampler for texture in textures]
    given = [gltf.samplers[number] for number in samplers if number is not None]
    if any({sampler.wrap_s, sampler.wrap_t} != {_REPEAT} for sampler in given):
        yield "textures that are clamped or mirrored at their borders; they repeat"
    for name in gltf.extensions_used:
        yield f"extension {printable(name)}"


def unread_obj(lines: Iterable[str]) -> list[str]:
    """Contents of a Wavefront OBJ file that are not read."""
    kinds = {words[0] for line in lines if (words := line.split())}
    if "vn" in kinds:
        kinds.discard("s")  # normals say the same
    return [phrase for word, phrase in _OBJ_WORDS.items() if word in kinds]


def unread_ply(elements: Iterable[str]) -> list[str]:
    """The elements of a PLY file that are not read."""
    return [f"element '{printable(name)}'" for name in elements if name not in _PLY_ELEMENTS]
