"""Unread contents of mesh files other than materials, a phrase each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from iprt.files.message_text import printable
from iprt.geometry.gltf_document import Gltf

_TRIANGLE_MODES = (4, 5)
_REPEAT = 10497
_READ_EXTENSIONS = (
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
    "KHR_texture_transform",
)
"""Extensions whose contents are read or reported with their subject. Compressed forms are listed
because they are optional here: files that require them are refused."""
_OBJ_WORDS = {
    "l": "lines",
    "p": "points",
    "curv": "curves",
    "surf": "curved surfaces",
    "s": "smoothing groups",
}
_PLY_ELEMENTS = ("vertex", "face")


def unread_gltf(gltf: Gltf, *, animated: bool) -> Iterator[str]:
    """Yield the unread contents of a glTF file; with `animated`, one animation counts as read."""
    for key in ("cameras",) if animated else ("animations", "cameras"):
        if count := len(getattr(gltf, key)):
            yield f"{key} ({count})"
    primitives = [primitive for mesh in gltf.meshes for primitive in mesh.primitives]
    if any(primitive.mode not in _TRIANGLE_MODES for primitive in primitives):
        yield "points, lines or triangle fans"
    if any(primitive.targets for primitive in primitives):
        yield "morph targets"
    textures = gltf.color_textures()
    if any(texture.coordinates for texture in textures):
        yield "a second set of texture coordinates; the first is used"
    samplers = [gltf.textures[texture.index].sampler for texture in textures]
    given = [gltf.samplers[number] for number in samplers if number is not None]
    if any({sampler.wrap_s, sampler.wrap_t} != {_REPEAT} for sampler in given):
        yield "textures that are clamped or mirrored at their borders; they repeat"
    for name in gltf.extensions_used:
        if name not in _READ_EXTENSIONS:
            yield f"extension {printable(name)}"


def unapplied_gltf(gltf: Gltf) -> Iterator[str]:
    """Yield unsupported properties of glTF materials that would change the look much."""
    used = {primitive.material for mesh in gltf.meshes for primitive in mesh.primitives}
    materials = [material for number, material in enumerate(gltf.materials) if number in used]
    modes = {material.alpha_mode for material in materials}
    if "MASK" in modes:
        yield "alphaMode MASK is not applied: cut-out parts are drawn opaque"
    if "BLEND" in modes:
        yield "alphaMode BLEND is not applied: transparent parts are drawn opaque"
    if any(texture.moved for texture in gltf.color_textures()):
        yield "KHR_texture_transform is not applied: textures are not shifted, turned or scaled"


def unread_obj(lines: Iterable[str]) -> list[str]:
    """Return the unread contents of a Wavefront OBJ file."""
    kinds = {words[0] for line in lines if (words := line.split())}
    if "vn" in kinds:
        kinds.discard("s")  # normals replace smoothing groups
    return [phrase for word, phrase in _OBJ_WORDS.items() if word in kinds]


def unread_ply(elements: Iterable[str]) -> list[str]:
    """Return the unread elements of a PLY file."""
    return [f"element '{printable(name)}'" for name in elements if name not in _PLY_ELEMENTS]
