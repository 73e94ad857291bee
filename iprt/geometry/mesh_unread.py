"""Unread contents of mesh files other than materials, a phrase each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from iprt.files.message_text import printable
from iprt.geometry.gltf_document import Gltf
from iprt.geometry.gltf_surfaces import UV_SETS

_TRIANGLE_MODES = (4, 5)
_READ_EXTENSIONS = (
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
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
    textures = gltf.read_textures()
    if any(texture.coordinates >= UV_SETS for texture in textures):
        yield "a third set of texture coordinates; the first is used"
    if any(material.misplaced for material in gltf.materials):
        yield "texture coordinates that differ between a material's textures; the color's are used"
    for name in gltf.extensions_used:
        if name not in _READ_EXTENSIONS:
            yield f"extension {printable(name)}"


def unread_obj(lines: Iterable[str]) -> list[str]:
    """Return the unread contents of a Wavefront OBJ file."""
    kinds = {words[0] for line in lines if (words := line.split())}
    if "vn" in kinds:
        kinds.discard("s")  # normals replace smoothing groups
    return [phrase for word, phrase in _OBJ_WORDS.items() if word in kinds]


def unread_ply(elements: Iterable[str]) -> list[str]:
    """Return the unread elements of a PLY file."""
    return [f"element '{printable(name)}'" for name in elements if name not in _PLY_ELEMENTS]
