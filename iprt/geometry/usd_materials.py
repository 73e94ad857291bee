"""Materials of USD files: UsdPreviewSurface, converted as glTF's are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.geometry.gltf_materials import LEAST_CUTOFF
from iprt.geometry.layers import Layers, variants_of
from iprt.geometry.material import MAX_EMISSION, Material, MaterialKind
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.reflectance import (
    LEAST_IOR,
    MAX_IOR,
    NEARLY,
    color_of,
    metal_or_not,
    plain_alpha,
    triple,
)
from iprt.geometry.sampler import PLAIN, Sampler
from iprt.geometry.textures import Textures
from iprt.geometry.usd_data import UsdMaterial, UsdTexture
from iprt.geometry.variants import distinct

CHANNELS = "rgba"


def from_usd(
    source: UsdMaterial, file: MeshFile, textures: Textures, dropped: list[str]
) -> Material:
    """Convert a UsdPreviewSurface; alpha = roughness²."""
    dropped.extend(source.unread)
    if source.misplaced:
        dropped.append(
            "texture coordinates that differ between a material's textures; the color's are used"
        )
    texture = _color(source.color_texture, file, textures)
    surface = _surface(source, file, textures)
    ior = float(np.clip(source.ior, LEAST_IOR, MAX_IOR))
    color = color_of(source.color)
    material = metal_or_not(color, source.metallic, source.roughness, texture, surface, ior)
    material = _with_opacity(material, source, file, textures)
    material = _coated(material, source, file, textures, dropped)
    if source.normal_texture is not None:
        normals = textures.normals(file.usd_picture(source.normal_texture.file), 1.0)
        # Renderers of the format, which does not say, bend the clear coat too.
        lacquer = normals if material.has_coat else None
        material = replace(material, normal_texture=normals, clearcoat_normal_texture=lacquer)
    emission = triple(source.emission, MAX_EMISSION)
    if max(emission) > 0.0:
        glow = _color(source.emission_texture, file, textures)
        material = replace(material, emission=emission, emission_texture=glow)
    rough = source.metallic_texture or source.roughness_texture
    color_or_opacity = source.color_texture or source.opacity_texture
    used = (color_or_opacity, rough, source.normal_texture, source.emission_texture)
    first, second, third, fourth = (_sampler(one) for one in used)
    samplers = (first, second, third, fourth, third)
    return replace(material, samplers=samplers, places=source.places)


def _coated(
    material: Material, source: UsdMaterial, file: MeshFile, textures: Textures, dropped: list[str]
) -> Material:
    """Return a material with its clear coat, and its maps."""
    if not source.clearcoat > 0.0:
        return material
    if material.kind == "dielectric":
        dropped.append("clearcoat of glass")
        return material
    if material.kind != "principled":
        ior = float(np.clip(source.ior, LEAST_IOR, MAX_IOR))
        material = replace(
            material, kind="principled", alpha=plain_alpha(source.roughness), ior=ior
        )
    layers = _coat_layers(source, file, textures)
    sampler = _sampler(source.clearcoat_texture or source.clearcoat_roughness_texture)
    return replace(
        material,
        clearcoat=float(layers.mean.clearcoat[0]),
        clearcoat_alpha=float(layers.mean.clearcoat_alpha[0]),
        variants=variants_of(layers, lambda _: material.ior, sampler, tinted=False),
    )


def _coat_layers(source: UsdMaterial, file: MeshFile, textures: Textures) -> Layers:
    """Return the clear coat at the texels of its textures."""
    used = source.clearcoat_texture, source.clearcoat_roughness_texture
    pictures = [None if one is None else file.usd_picture(one.file) for one in used]
    sizes = [picture.size for picture in pictures if picture is not None]
    width, height = (max((size[axis] for size in sizes), default=1) for axis in (0, 1))
    planes = np.full((2, height, width), 255, np.uint8)
    for plane, one, picture in zip(planes, used, pictures, strict=True):
        if one is not None and picture is not None:
            channels = textures.channels(picture, (width, height))
            plane[:] = channels[..., CHANNELS.index(one.channel)]
    if sizes:
        textures.count(width * height)
    values, number = distinct(planes.reshape(2, -1))
    strength, roughness = values.T / 255.0
    count = len(values)
    return Layers(
        clearcoat=float(np.clip(source.clearcoat, 0.0, 1.0)) * strength,
        clearcoat_alpha=plain_alpha(source.clearcoat_roughness) * roughness**2,
        sheen=np.zeros((count, 3)),
        sheen_alpha=np.full(count, Material.sheen_alpha),
        specular=np.ones((count, 3)),
        transmission=np.zeros(count),
        weights=np.bincount(number).astype(np.float64),
        number=number.reshape(height, width),
    )


def _sampler(texture: UsdTexture | None) -> Sampler:
    return PLAIN if texture is None else Sampler(texture.wrap)


def _color(
    texture: UsdTexture | None, file: MeshFile, textures: Textures
) -> NDArray[np.float32] | None:
    if texture is None:
        return None
    picture = file.usd_picture(texture.file)
    return textures.stored(picture) if texture.linear else textures.linear(picture)


def _surface(source: UsdMaterial, file: MeshFile, textures: Textures) -> NDArray[np.float32] | None:
    """Return factors (H, W, 2) of metalness and roughness, of the size of the larger picture."""
    metallic, roughness = (
        _channel(one, file) for one in (source.metallic_texture, source.roughness_texture)
    )
    if metallic is None and roughness is None:
        return None
    sizes = [one.size for one in (metallic, roughness) if one is not None]
    width, height = max(sizes, key=lambda size: size[0] * size[1])
    one = Image.new("L", (width, height), 255)
    planes = [
        one if plane is None else plane.resize((width, height)) for plane in (roughness, metallic)
    ]
    return textures.surface(Image.merge("RGB", (one, *planes)))


def _channel(texture: UsdTexture | None, file: MeshFile) -> Image.Image | None:
    """Return one channel of a texture's picture; grey pictures have the same in all."""
    if texture is None:
        return None
    picture = file.usd_picture(texture.file).convert("RGBA")
    return picture.getchannel(CHANNELS.index(texture.channel))


def _with_opacity(
    material: Material, source: UsdMaterial, file: MeshFile, textures: Textures
) -> Material:
    """Return a material with holes, or one that lets light pass.

    A constant opacity below 1 means glass, which still reflects; it is a solid where the mesh is
    closed. With a picture or a threshold, or where opacity means presence, it makes holes.
    """
    opacity = float(np.clip(source.opacity, 0.0, 1.0))
    mask = _channel(source.opacity_texture, file)
    if mask is None and opacity > 1.0 - NEARLY:
        return material
    if mask is None and source.threshold <= 0.0 and not source.presence:
        return _transmitting(material, source, 1.0 - opacity)
    texture, factors = material.texture, None
    if mask is not None:
        if texture is None:
            texture = np.ones((mask.height, mask.width, 3), np.float32)
            textures.count(mask.height * mask.width)
        size = texture.shape[1], texture.shape[0]
        factors = textures.factors(mask.resize(size))
    return replace(
        material,
        texture=texture,
        opacity=opacity,
        opacity_texture=factors,
        cutoff=max(source.threshold, LEAST_CUTOFF) if source.threshold > 0.0 else 0.0,
    )


def _transmitting(material: Material, source: UsdMaterial, share: float) -> Material:
    if material.kind != "principled":
        alpha = float(np.clip(source.roughness, 0.0, 1.0)) ** 2
        kind: MaterialKind = "dielectric" if share > 1.0 - NEARLY else "principled"
        ior = float(np.clip(source.ior, LEAST_IOR, MAX_IOR))
        material = Material(kind, material.albedo, alpha=alpha, ior=ior, texture=material.texture)
    return replace(material, transmission=share) if material.kind == "principled" else material
