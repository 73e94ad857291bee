"""Conversion of mesh-file materials to the kinds that are rendered."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.files.images import decode_srgb, has_alpha, texture_alpha, texture_pixels
from iprt.files.message_text import printable
from iprt.files.safe_reading import MAX_PIXELS
from iprt.geometry.gltf_document import GltfMaterial, TextureReference
from iprt.geometry.material import MAX_EMISSION, PLAIN, Material, Sampler, Wrap
from iprt.geometry.mesh_files import MeshFile

DEFAULT_MATERIAL = Material("diffuse", (0.5, 0.5, 0.5))
MATTE_ROUGHNESS = 0.9
"""glTF roughness from which a dielectric counts as diffuse, because its coat no longer shows."""
WRAPS: Mapping[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
NEAREST = 9728
"""Numbers of OpenGL in glTF's samplers."""
LEAST_CUTOFF = 1e-6
"""Stands for a cutoff of 0, which in `Material` means none."""
NEARLY = 1e-3
"""Distance from 0 or 1 below which metalness counts as exact, for converters' rounding."""
GLOSSY_SPECULAR = 0.04
"""Least specular reflectance (Ks) of an MTL material that gets a coat."""
LEAST_IOR, MAX_IOR = 1.001, 4.0
"""Limits of the index of refraction; the upper one is the same as in `scene.toml`."""
MAX_REFLECTANCE = 0.36
"""Reflectance of `MAX_IOR` at normal incidence."""
_READ_KEYS = {"map_kd", "kd", "ks", "ns", "ni", "pr", "pm", "name", "image", "diffuse", "specular"}
_MAPS = {"bump", "norm", "disp", "refl"}
_SAYS_NOTHING = {"ambient", "ka", "glossiness", "illum"}
"""Keys without meaning here: ambient light, and the choice of MTL's shading formula."""


class Textures:
    """Decoded textures of one mesh file, each stored once and shared by its materials."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._texels = 0
        self._decoded: dict[bytes, NDArray[np.float32]] = {}

    def count(self, texels: int) -> None:
        """Add the texels of a texture to the total; raise FormatError above the limit."""
        self._texels += texels
        if self._texels > MAX_PIXELS:
            raise FormatError(
                f"{self._path}: its textures have more than the {MAX_PIXELS} pixels that are "
                "read; make them smaller (colors of vertices take four for each triangle)"
            )

    def linear(self, image: Any) -> NDArray[np.float32] | None:
        """Return the linear (H, W, 3) float32 texels of a Pillow image; None for other objects.

        Raises
        ------
        FormatError
            The image is damaged or of an unread format, or the total of texels is too large.
        """
        return self._decode(image, "color", decode_srgb)

    def surface(self, image: Any) -> NDArray[np.float32] | None:
        """Return metalness and roughness, (H, W, 2) float32, of a glTF map; errors as above.

        The blue channel holds metalness, the green one roughness (section 3.9.2).
        """
        return self._decode(image, "surface", lambda pixels: _fractions(pixels[..., 2:0:-1]))

    def opacity(self, image: Any) -> NDArray[np.float32] | None:
        """Return the alpha channel (H, W) float32, None if all of it is 1; errors as above."""
        if not isinstance(image, Image.Image) or not has_alpha(image):
            return None
        alpha = texture_alpha(image, self._path)
        return None if alpha.min() == 255 else _fractions(alpha)

    def normals(self, image: Any, scale: float) -> NDArray[np.float32] | None:
        """Return the vectors (H, W, 3) float32 of a normal map; errors as above.

        `scale` multiplies their x and y (section 3.9.3).
        """
        stretch = np.array([scale, scale, 1.0], np.float32)

        def vectors(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
            return np.asarray((2.0 * _fractions(pixels) - 1.0) * stretch, np.float32)

        return self._decode(image, f"normals {scale}", vectors)

    def _decode(
        self,
        image: Any,
        use: str,
        decode: Callable[[NDArray[np.uint8]], NDArray[np.float32]],
    ) -> NDArray[np.float32] | None:
        if not isinstance(image, Image.Image):
            return None
        pixels = texture_pixels(image, self._path)
        key = f"{use} {pixels.shape}".encode()
        digest = hashlib.blake2b(key + pixels.tobytes()).digest()
        if digest not in self._decoded:
            self.count(pixels.shape[0] * pixels.shape[1])
            self._decoded[digest] = decode(pixels)
        return self._decoded[digest]


def _fractions(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
    return np.divide(pixels, 255.0, dtype=np.float32)


def has_texture(source: Any) -> bool:
    """Return True if a material of a file (or None) has a texture that is read."""
    if isinstance(source, GltfMaterial):
        return bool(source.textures())
    return isinstance(getattr(source, "image", None), Image.Image)


def convert_material(
    source: Any, file: MeshFile, textures: Textures, dropped: list[str]
) -> Material:
    """Convert a material of a file, and append the properties that are lost to `dropped`.

    Parameters
    ----------
    source : GltfMaterial, trimesh SimpleMaterial (MTL) or None
    """
    if source is None:
        return DEFAULT_MATERIAL
    if isinstance(source, GltfMaterial):
        return _from_gltf(source, file, textures, dropped)
    return _from_mtl(source, textures, dropped)


def tinted(material: Material, color: tuple[float, float, float] | None) -> Material:
    """Return a material multiplied by a color, or unchanged if the color is None."""
    if color is None:
        return material
    if _is_unlit(material):
        tint = np.multiply(material.emission, color)
        return replace(material, emission=_triple(tint, MAX_EMISSION))
    own = (1.0, 1.0, 1.0) if material is DEFAULT_MATERIAL else material.albedo
    return replace(material, albedo=_color(np.multiply(own, color)))


def colored(material: Material, texture: NDArray[np.float32]) -> Material:
    """Return a material with a color texture."""
    if _is_unlit(material):
        return replace(material, emission_texture=texture)
    return replace(material, texture=texture)


def _is_unlit(material: Material) -> bool:
    return material.emits and max(material.albedo) == 0.0


def _from_gltf(
    source: GltfMaterial, file: MeshFile, textures: Textures, dropped: list[str]
) -> Material:
    """Convert a glTF material; alpha = roughness²."""
    pbr = source.pbr_metallic_roughness
    if source.occlusion_texture is not None:
        dropped.append("occlusion map")
    factor, metallic, roughness = (
        pbr.base_color_factor,
        pbr.metallic_factor,
        pbr.roughness_factor,
    )
    if source.glossiness is not None:
        factor, metallic = source.glossiness.diffuse_factor, 0.0
        roughness = 1.0 - source.glossiness.glossiness_factor

    color, opacity = factor[:3], factor[3]

    def picture(reference: TextureReference | None) -> Image.Image | None:
        assert file.gltf is not None
        image = None if reference is None else file.gltf.textures[reference.index].image
        return None if image is None else file.picture(image)

    base, surface, normals = next(iter(source.color_textures()), None), None, None
    if source.glossiness is None:
        surface = textures.surface(picture(pbr.metallic_roughness_texture))
    if source.normal_texture is not None:
        bumps = picture(source.normal_texture)
        normals = textures.normals(bumps, source.normal_texture.scale)
    texture = textures.linear(picture(base))
    if source.unlit is not None:
        surface = normals = None
        material = Material(
            "diffuse", (0.0, 0.0, 0.0), emission=_color(color), emission_texture=texture
        )
    else:
        ior = _index_of_refraction(source, dropped)
        material = _metal_or_not(_color(color), metallic, roughness, texture, surface, ior)
    references = (
        base,
        pbr.metallic_roughness_texture,
        source.normal_texture,
        source.emissive_texture if source.unlit is None else base,
    )
    first, second, third, fourth = (_sampler(file, reference) for reference in references)
    material = replace(material, samplers=(first, second, third, fourth))
    if max(source.emissive_factor) > 0.0 and source.unlit is None:
        strength = 1.0 if source.strength is None else source.strength.emissive_strength
        glow = textures.linear(picture(source.emissive_texture))
        emission = _triple(np.multiply(source.emissive_factor, strength), MAX_EMISSION)
        material = replace(material, emission=emission, emission_texture=glow)
    material = material if normals is None else replace(material, normal_texture=normals)
    if source.alpha_mode not in ("MASK", "BLEND"):
        return material
    return replace(
        material,
        texture=texture,  # opacity is in its fourth channel
        opacity=float(np.clip(opacity, 0.0, 1.0)),
        opacity_texture=None if texture is None else textures.opacity(picture(base)),
        cutoff=max(source.alpha_cutoff, LEAST_CUTOFF) if source.alpha_mode == "MASK" else 0.0,
    )


def _sampler(file: MeshFile, reference: TextureReference | None) -> Sampler:
    """Return the sampler of a texture (section 3.8.4)."""
    assert file.gltf is not None
    number = None if reference is None else file.gltf.textures[reference.index].sampler
    if number is None:
        return PLAIN
    given = file.gltf.samplers[number]
    u, v = (WRAPS.get(mode, "repeat") for mode in (given.wrap_s, given.wrap_t))
    return Sampler((u, v), nearest=given.mag_filter == NEAREST)


def _metal_or_not(
    albedo: tuple[float, float, float],
    metallic: float,
    roughness: float,
    texture: NDArray[np.float32] | None,
    surface: NDArray[np.float32] | None = None,
    ior: float = Material.ior,
) -> Material:
    """Return the simplest material of glTF's parameters (glTF 2.0, section 3.9.2).

    It is plastic without metalness and maps of it, and diffuse if that is rough or reflects
    nothing.
    """
    metallic, roughness = float(np.clip(metallic, 0.0, 1.0)), float(np.clip(roughness, 0.0, 1.0))
    alpha = roughness**2
    if surface is not None or metallic > NEARLY:
        metallic = 1.0 if metallic > 1.0 - NEARLY else metallic
        return Material(
            "principled",
            albedo,
            alpha=alpha,
            ior=ior,
            texture=texture,
            metallic=metallic,
            surface_texture=surface,
        )
    if roughness >= MATTE_ROUGHNESS or ior <= LEAST_IOR:
        return Material("diffuse", albedo, texture=texture)
    return Material("plastic", albedo, alpha=alpha, ior=ior, texture=texture)


def _index_of_refraction(source: GltfMaterial, dropped: list[str]) -> float:
    """Return the index of refraction whose reflectance at normal incidence is the material's.

    KHR_materials_specular multiplies that reflectance. A colored one becomes grey, which `dropped`
    names, as it does maps.
    """
    ior = Material.ior if source.refraction is None else source.refraction.ior
    ior = MAX_IOR if ior == 0.0 else ior  # 0 stands for a reflectance of 1
    given = source.specular
    if given is not None and ior > 0.0:
        color = given.specular_color_factor
        if given.specular_texture is not None or given.specular_color_texture is not None:
            dropped.append("map of specular strength")
        if max(color) - min(color) > NEARLY:
            dropped.append("color of the specular reflection")
        factor = given.specular_factor * sum(color) / 3.0
        reflectance = factor * ((ior - 1.0) / (ior + 1.0)) ** 2
        root = float(np.sqrt(np.clip(reflectance, 0.0, MAX_REFLECTANCE)))
        ior = (1.0 + root) / (1.0 - root)
    return min(max(ior, LEAST_IOR), MAX_IOR)


def _from_mtl(source: Any, textures: Textures, dropped: list[str]) -> Material:
    """Convert an MTL material, with its emission (Ke)."""
    emission = _triple(source.kwargs.get("ke", [0.0, 0.0, 0.0]), MAX_EMISSION)
    return replace(_reflectance_of_mtl(source, textures, dropped), emission=emission)


def _reflectance_of_mtl(source: Any, textures: Textures, dropped: list[str]) -> Material:
    """Convert an MTL material: diffuse (Kd), with a coat if Ks and the exponent Ns are glossy.

    A Phong exponent n is about as wide as GGX with alpha = sqrt(2 / (n + 2)) (Walter et al.,
    "Microfacet Models for Refraction", 2007, section 5.2, for Beckmann). Roughness (Pr) and
    metalness (Pm) mean the same as in glTF and take precedence.
    """
    values = source.kwargs
    albedo = _color(values.get("kd", [1.0, 1.0, 1.0]))
    texture = textures.linear(source.image)
    # Most files repeat the color texture as map_Ka.
    read = {"map_ka"} if texture is not None else set()
    dropped.extend(_unread_mtl({key: values[key] for key in values if key not in read}))
    exponent = _first(values.get("ns"), 0.0)
    alpha = float(np.sqrt(2.0 / (exponent + 2.0))) if exponent >= 1.0 else 1.0
    if "pr" in values or "pm" in values:
        roughness = _first(values.get("pr"), float(np.sqrt(alpha)))
        metallic = _first(values.get("pm"), 0.0)
        return _metal_or_not(albedo, metallic, roughness, texture)
    specular = max(_color(values.get("ks", [0.0, 0.0, 0.0])))
    if specular >= GLOSSY_SPECULAR and exponent >= 1.0:
        ior = _first(values.get("ni"), 0.0)
        ior = ior if 1.0 < ior <= MAX_IOR else Material.ior
        return Material("plastic", albedo, alpha=alpha, ior=ior, texture=texture)
    return Material("diffuse", albedo, texture=texture)


def _unread_mtl(values: dict[str, Any]) -> Iterator[str]:
    """Yield a phrase for each unsupported property of an MTL material."""
    opaque = _first(values.get("d"), 1.0) >= 1.0 and _first(values.get("tr"), 0.0) <= 0.0
    if not opaque or "map_d" in values:  # map_d is often the color texture
        yield "transparency"
    for key in sorted(set(values) - _READ_KEYS - _SAYS_NOTHING - {"d", "map_d", "tr", "ke"}):
        if key.startswith("map_") or key in _MAPS:
            yield f"texture {printable(key)}"
        elif key == "tf":
            if min(_color(values[key])) < 1.0:
                yield "a transmission filter (Tf)"
        elif _first(values[key], 1.0) != 0.0:
            yield f"'{printable(key)}' of its materials"


def _triple(values: Any, most: float) -> tuple[float, float, float]:
    """Return three numbers in [0, most]."""
    try:
        given = np.asarray(values, np.float64)
    except (ValueError, TypeError):
        given = np.zeros(3)
    r, g, b = np.clip(np.nan_to_num(np.resize(given, 3)), 0.0, most)
    return float(r), float(g), float(b)


def _color(values: Any) -> tuple[float, float, float]:
    """Return an RGB color; MTL may give one value for all channels, or no numbers (black)."""
    return _triple(values, 1.0)


def _first(value: Any, default: float) -> float:
    """Return an MTL number, given as a float or a list with one."""
    try:
        number = float(np.ravel(value)[0]) if value is not None else default
    except (ValueError, TypeError, IndexError):
        return default
    return number if np.isfinite(number) else default
