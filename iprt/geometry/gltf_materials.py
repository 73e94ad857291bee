"""Materials of glTF files (Khronos glTF 2.0, section 3.9, and its extensions)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from PIL import Image

from iprt.geometry.gltf_cover import covered
from iprt.geometry.gltf_layers import index_of_refraction, layers_of
from iprt.geometry.gltf_surfaces import GltfMaterial, TextureReference
from iprt.geometry.material import MAX_ABSORPTION, MAX_EMISSION, Material, MaterialKind
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.reflectance import (
    NEARLY,
    color_of,
    metal_or_not,
    plain_alpha,
    triple,
)
from iprt.geometry.sampler import PLAIN, Sampler, Wrap
from iprt.geometry.textures import Textures

WRAPS: Mapping[int, Wrap] = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
NEAREST = 9728
"""Numbers of OpenGL in glTF's samplers."""
LEAST_CUTOFF = 1e-6
"""Stands for a cutoff of 0, which in `Material` means none."""
LEAST_PASSING, LEAST_DISTANCE = 1e-4, 1e-4
"""Limits of attenuation: the color, and the distance in metres."""


def from_gltf(
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
            "diffuse", (0.0, 0.0, 0.0), emission=color_of(color), emission_texture=texture
        )
    else:
        layers = layers_of(source, picture, textures)
        ior = index_of_refraction(source, layers.mean.specular[0])
        material = metal_or_not(color_of(color), metallic, roughness, texture, surface, ior)
        share = float(layers.mean.transmission[0])
        material = _transmitting(material, source, share, roughness, ior)
        sampler = _sampler(file, next(iter(source.varying().values()), None))
        material = covered(material, source, (roughness, ior), layers, sampler, dropped)
        lacquer = source.coat_normal_texture
        if lacquer is not None and material.has_coat:
            bent = textures.normals(picture(lacquer), lacquer.scale)
            material = replace(material, clearcoat_normal_texture=bent)
    references = (
        base,
        pbr.metallic_roughness_texture,
        source.normal_texture,
        source.emissive_texture if source.unlit is None else base,
        source.coat_normal_texture,
    )
    first, second, third, fourth, fifth = (_sampler(file, reference) for reference in references)
    samplers = (first, second, third, fourth, fifth)
    material = replace(material, samplers=samplers, places=source.places)
    if max(source.emissive_factor) > 0.0 and source.unlit is None:
        strength = 1.0 if source.strength is None else source.strength.emissive_strength
        glow = textures.linear(picture(source.emissive_texture))
        emission = triple(np.multiply(source.emissive_factor, strength), MAX_EMISSION)
        material = replace(material, emission=emission, emission_texture=glow)
    material = material if normals is None else replace(material, normal_texture=normals)
    if not source.has_opacity:
        return material
    return replace(
        material,
        texture=texture,  # opacity is in its fourth channel
        opacity=float(np.clip(opacity, 0.0, 1.0)),
        opacity_texture=None if texture is None else textures.opacity(picture(base)),
        cutoff=max(source.alpha_cutoff, LEAST_CUTOFF) if source.alpha_mode == "MASK" else 0.0,
    )


def _transmitting(
    material: Material,
    source: GltfMaterial,
    share: float,
    roughness: float,
    ior: float,
) -> Material:
    """Return a material with transmission and volume (KHR_materials_transmission and _volume).

    Without a thickness, it is a thin wall. `share` is the mean of the transmission.
    """
    if not share > 0.0:
        return material
    volume, absorption = source.volume, (0.0, 0.0, 0.0)
    solid = volume is not None and volume.thickness_factor > 0.0
    if volume is not None and volume.attenuation_distance is not None:
        passed = np.clip(volume.attenuation_color, LEAST_PASSING, 1.0)
        distance = max(volume.attenuation_distance, LEAST_DISTANCE)
        absorption = triple(-np.log(passed) / distance, MAX_ABSORPTION)
    if material.kind != "principled":
        alpha = plain_alpha(roughness)
        kind: MaterialKind = "dielectric" if share > 1.0 - NEARLY else "principled"
        material = Material(kind, material.albedo, alpha=alpha, ior=ior, texture=material.texture)
    if material.kind == "principled":
        material = replace(material, transmission=share)
    return replace(material, thin=not solid, absorption=absorption if solid else (0.0, 0.0, 0.0))


def _sampler(file: MeshFile, reference: TextureReference | None) -> Sampler:
    """Return the sampler of a texture (section 3.8.4)."""
    assert file.gltf is not None
    number = None if reference is None else file.gltf.textures[reference.index].sampler
    if number is None:
        return PLAIN
    given = file.gltf.samplers[number]
    u, v = (WRAPS.get(mode, "repeat") for mode in (given.wrap_s, given.wrap_t))
    return Sampler((u, v), nearest=given.mag_filter == NEAREST)
