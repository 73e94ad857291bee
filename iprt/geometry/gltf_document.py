"""Data model of a glTF document, validated by pydantic.

Specification: Khronos glTF 2.0, sections 3.5 (scenes), 3.6 (binary data), 3.7 (meshes), 3.9
(materials). Parts that are not read are left out.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AliasPath, BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from iprt.files.safe_reading import MAX_BYTES, MAX_VERTICES

MAX_PARTS = 2**17
"""Limit for accessors, buffer views and buffers of a document, each."""
MAX_NODES = 2**14
"""Limit for nodes and primitives of a document, each; all of them are visited in Python."""
TRIANGLES, TRIANGLE_STRIP = 4, 5
"""Modes of primitives that are read."""

_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

Coefficients = tuple[tuple[float, float, float], tuple[float, float, float]]
IDENTITY: Coefficients = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
"""Map of texture coordinates without KHR_texture_transform."""

Index = Annotated[int, Field(ge=0)]
Bytes = Annotated[int, Field(ge=0, le=MAX_BYTES)]
Number = Annotated[float, Field(allow_inf_nan=False)]

Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Quadruple = Annotated[list[Number], Field(min_length=4, max_length=4)]
Matrix = Annotated[list[Number], Field(min_length=16, max_length=16)]


class Part(BaseModel):
    """A part of a glTF document; unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore", strict=True, alias_generator=to_camel)


Model = TypeVar("Model", bound=Part)


def _extension(*path: str) -> Any:
    """Return a field with a value in the part's `extensions`, or None."""
    return Field(default=None, validation_alias=AliasPath("extensions", *path))


class Buffer(Part):
    """A buffer: binary data in a file or in the document."""

    uri: str | None = None
    byte_length: Bytes


class BufferView(Part):
    """A buffer view: a range of a buffer."""

    buffer: Index
    byte_offset: Bytes = 0
    byte_length: Bytes
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class SparsePart(Part):
    """A place of the indices or of the values of replaced elements."""

    buffer_view: Index
    byte_offset: Bytes = 0
    component_type: Literal[5121, 5123, 5125] = 5125


class Sparse(Part):
    """Replaced elements of an accessor (section 3.6.2.3)."""

    count: Annotated[int, Field(ge=1, le=MAX_VERTICES)]
    indices: SparsePart
    values: SparsePart


class Accessor(Part):
    """An accessor: typed elements in a buffer view, zeros without one."""

    buffer_view: Index | None = None
    byte_offset: Bytes = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Annotated[int, Field(ge=0, le=MAX_VERTICES)]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Sparse | None = None
    normalized: bool = False

    def replaced(self) -> tuple[Accessor, Accessor] | None:
        """Return accessors of the indices and values of replaced elements."""
        if self.sparse is None:
            return None

        def stored(part: SparsePart, **other: Any) -> Accessor:
            where = {"buffer_view": part.buffer_view, "byte_offset": part.byte_offset}
            return self.model_copy(update={**where, "count": count, "sparse": None, **other})

        count, indices = self.sparse.count, self.sparse.indices
        rows = stored(indices, component_type=indices.component_type, type="SCALAR")
        return rows, stored(self.sparse.values)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the components."""
        return np.dtype(_DTYPES[self.component_type])

    @property
    def item_bytes(self) -> int:
        """Size of an element in bytes."""
        return self.dtype.itemsize * _COMPONENTS[self.type]


class Image(Part):
    """An image, in a file or in a buffer view."""

    uri: str | None = None
    buffer_view: Index | None = None


class Sampler(Part):
    """A texture sampler; the filter of small textures is read, mipmaps are always used."""

    mag_filter: int | None = None
    wrap_s: int = 10497
    wrap_t: int = 10497


class Texture(Part):
    """A texture: an image and a sampler."""

    source: Index | None = None
    sampler: Index | None = None
    webp: Index | None = _extension("EXT_texture_webp", "source")
    basisu: Index | None = _extension("KHR_texture_basisu", "source")

    @property
    def image(self) -> int | None:
        """Index of the image to read: the WebP image, which Pillow reads, or else the core one."""
        return self.source if self.webp is None else self.webp


class TextureTransform(Part):
    """A transform of texture coordinates (KHR_texture_transform)."""

    offset: Pair = Field(default=[0.0, 0.0])
    rotation: Number = 0.0
    scale: Pair = Field(default=[1.0, 1.0])
    tex_coord: Index | None = None

    @property
    def matrix(self) -> Coefficients:
        """Rows of the (2, 3) map of texture coordinates, v down.

        A positive rotation turns coordinates counter-clockwise as an image shows them.
        """
        c, s = float(np.cos(self.rotation)), float(np.sin(self.rotation))
        (x, y), (right, down) = self.scale, self.offset
        return (c * x, s * y, right), (-s * x, c * y, down)


class TextureReference(Part):
    """A material's reference to a texture."""

    index: Index
    tex_coord: Index = 0
    transform: TextureTransform | None = _extension("KHR_texture_transform")

    @property
    def coordinates(self) -> int:
        """Index of the texture coordinate set."""
        given = None if self.transform is None else self.transform.tex_coord
        return self.tex_coord if given is None else given

    @property
    def placement(self) -> tuple[int, Coefficients]:
        """Texture coordinate set, and the map of its coordinates (`TextureTransform.matrix`)."""
        return self.coordinates, IDENTITY if self.transform is None else self.transform.matrix


class NormalTexture(TextureReference):
    """A material's reference to a normal map."""

    scale: Number = 1.0


class PbrMetallicRoughness(Part):
    """The metallic-roughness parameters of a material."""

    base_color_factor: Quadruple = Field(default=[1.0, 1.0, 1.0, 1.0])
    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    base_color_texture: TextureReference | None = None
    metallic_roughness_texture: TextureReference | None = None


class SpecularGlossiness(Part):
    """The specular-glossiness parameters of a material that are read."""

    diffuse_factor: Quadruple = Field(default=[1.0, 1.0, 1.0, 1.0])
    glossiness_factor: Number = 1.0
    diffuse_texture: TextureReference | None = None


class EmissiveStrength(Part):
    """The factor of a material's emission."""

    emissive_strength: Number = 1.0


class IndexOfRefraction(Part):
    """The index of refraction of a material."""

    ior: Number = 1.5


class Specular(Part):
    """The strength of a dielectric's reflection; textures are named, not read."""

    specular_factor: Number = 1.0
    specular_color_factor: Triple = Field(default=[1.0, 1.0, 1.0])
    specular_texture: Any = None
    specular_color_texture: Any = None


class Transmission(Part):
    """The share of light that a surface transmits; a texture is named, not read."""

    transmission_factor: Number = 0.0
    transmission_texture: Any = None


class Volume(Part):
    """The inside of a material; a thickness other than 0 makes it a solid."""

    thickness_factor: Number = 0.0
    attenuation_distance: Number | None = None
    attenuation_color: Triple = Field(default=[1.0, 1.0, 1.0])


class GltfMaterial(Part):
    """A material."""

    name: str | None = None
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: Number = 0.5
    emissive_factor: Triple = Field(default=[0.0, 0.0, 0.0])
    normal_texture: NormalTexture | None = None
    occlusion_texture: Any = None
    emissive_texture: TextureReference | None = None
    pbr_metallic_roughness: PbrMetallicRoughness = Field(default=PbrMetallicRoughness())
    glossiness: SpecularGlossiness | None = _extension("KHR_materials_pbrSpecularGlossiness")
    strength: EmissiveStrength | None = _extension("KHR_materials_emissive_strength")
    refraction: IndexOfRefraction | None = _extension("KHR_materials_ior")
    specular: Specular | None = _extension("KHR_materials_specular")
    transmission: Transmission | None = _extension("KHR_materials_transmission")
    volume: Volume | None = _extension("KHR_materials_volume")
    unlit: Any = _extension("KHR_materials_unlit")

    def color_textures(self) -> list[TextureReference]:
        """Return the color textures of this material."""
        other = None if self.glossiness is None else self.glossiness.diffuse_texture
        given = [self.pbr_metallic_roughness.base_color_texture, other]
        return [texture for texture in given if texture is not None]

    def textures(self) -> list[TextureReference]:
        """Return the textures of this material that are read."""
        surface = None
        if self.glossiness is None:
            surface = self.pbr_metallic_roughness.metallic_roughness_texture
        glow = self.emissive_texture if max(self.emissive_factor) > 0.0 else None
        others = [surface, self.normal_texture, glow]
        if self.unlit is not None:
            return self.color_textures()[:1]
        return self.color_textures()[:1] + [one for one in others if one is not None]

    @property
    def placement(self) -> tuple[int, Coefficients]:
        """`TextureReference.placement` of the first texture that is read, used for all of them."""
        return next((one.placement for one in self.textures()), (0, IDENTITY))


class Primitive(Part):
    """A primitive: vertices and indices with one material."""

    attributes: dict[str, Index]
    draco: Any = _extension("KHR_draco_mesh_compression")
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = TRIANGLES
    targets: list[Any] = Field(default=[])


class GltfMesh(Part):
    """A mesh."""

    name: str | None = None
    primitives: Annotated[list[Primitive], Field(min_length=1)]


class Node(Part):
    """A node: a transform with a mesh, a skin and children."""

    name: str | None = None
    children: list[Index] = Field(default=[])
    mesh: Index | None = None
    skin: Index | None = None
    matrix: Matrix | None = None
    translation: Triple | None = None
    rotation: Quadruple | None = None
    scale: Triple | None = None


class GltfScene(Part):
    """A scene: the roots of its node trees."""

    nodes: list[Index] = Field(default=[])


class Gltf(Part):
    """The parts of a document that are read."""

    scene: Index = 0
    scenes: list[GltfScene] = Field(default=[])
    nodes: Annotated[list[Node], Field(max_length=MAX_NODES)] = Field(default=[])
    meshes: Annotated[list[GltfMesh], Field(max_length=MAX_NODES)] = Field(default=[])
    materials: Annotated[list[GltfMaterial], Field(max_length=MAX_NODES)] = Field(default=[])
    textures: list[Texture] = Field(default=[])
    samplers: list[Sampler] = Field(default=[])
    images: Annotated[list[Image], Field(max_length=MAX_PARTS)] = Field(default=[])
    accessors: Annotated[list[Accessor], Field(max_length=MAX_PARTS)] = Field(default=[])
    buffer_views: Annotated[list[BufferView], Field(max_length=MAX_PARTS)] = Field(default=[])
    buffers: Annotated[list[Buffer], Field(max_length=MAX_PARTS)] = Field(default=[])
    animations: list[Any] = Field(default=[])
    skins: list[Any] = Field(default=[])
    cameras: list[Any] = Field(default=[])
    extensions_used: list[str] = Field(default=[])
    extensions_required: list[str] = Field(default=[])

    def uris(self) -> list[str]:
        """Return the URIs of buffers and images outside the binary chunk."""
        named = [*(buffer.uri for buffer in self.buffers), *(image.uri for image in self.images)]
        return [uri for uri in named if uri is not None]

    def roots(self) -> list[int]:
        """Return the root nodes of the scene; of a document without scenes, all roots."""
        if self.scenes:
            return list(dict.fromkeys(self.scenes[self.scene].nodes))
        children = {child for node in self.nodes for child in node.children}
        return [index for index in range(len(self.nodes)) if index not in children]

    def read_images(self) -> list[int]:
        """Return the indices of the images of the textures that are read."""
        images = [self.textures[texture.index].image for texture in self.read_textures()]
        return list(dict.fromkeys(image for image in images if image is not None))

    def read_textures(self) -> list[TextureReference]:
        """Return the textures of all materials that are read."""
        return [texture for material in self.materials for texture in material.textures()]


def parsed_gltf(document: Any) -> Gltf:
    """Parse a document whose parts have the right shapes; `check_gltf` checks their references.

    Raises
    ------
    ValueError
        The document is malformed; the message names the first fault in one line.
    """
    return parsed_part(Gltf, document, "")


def parsed_part(model: type[Model], value: Any, where: str) -> Model:
    """Parse a part of a document, or raise a ValueError that names the first fault in one line."""
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise ValueError(_first_fault(error, where)) from None


def _first_fault(error: ValidationError, where: str = "") -> str:
    """Return the first validation error in one line, with its key below `where`."""
    fault = error.errors(include_url=False, include_input=False)[0]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"])
    return f"{(where + key).lstrip('.') or 'document'}: {fault['msg']}"
