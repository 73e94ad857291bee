"""Layers above glTF materials: KHR_materials_clearcoat and _sheen, and the tint of _specular."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PIL import Image

from iprt.geometry.gltf_surfaces import Clearcoat, GltfMaterial, Sheen, TextureReference
from iprt.geometry.material import Material
from iprt.geometry.reflectance import NEARLY, color_of, plain_alpha, triple
from iprt.geometry.textures import ALPHA, GREEN, RED, Textures

Picture = Callable[[TextureReference | None], Image.Image | None]


def covered(
    material: Material,
    source: GltfMaterial,
    base: tuple[float, float],
    picture: Picture,
    textures: Textures,
    dropped: list[str],
) -> Material:
    """Return a material below the clear coat and sheen of its source, and with its tint.

    `dropped` gets phrases for approximations, and for layers that glass cannot have.

    Parameters
    ----------
    base : (float, float)
        Roughness and index of refraction, for a material without a coat of its own.
    picture : callable
        Returns the decoded image of a texture.
    """
    whole = replace(material, kind="principled")
    if material.kind in ("diffuse", "plastic"):
        roughness, ior = base
        whole = replace(whole, alpha=plain_alpha(roughness), ior=ior)
    if material.kind != "diffuse" and (material.metallic < 1.0 or material.maps[1] is not None):
        whole = replace(whole, tint=tint_of(source))
    if source.clearcoat is not None:
        whole = _coated(whole, source.clearcoat, picture, textures, dropped)
    if source.sheen is not None:
        whole = _with_sheen(whole, source.sheen, picture, textures, dropped)
    if material.kind == "dielectric":
        dropped += [name for name, given in _names(whole).items() if given]
        return material
    return whole if whole.is_covered else material


def tint_of(source: GltfMaterial) -> tuple[float, float, float]:
    """Return the color of the reflection at normal incidence, whose greatest channel is 1."""
    given = source.specular
    if given is None:
        return 1.0, 1.0, 1.0
    color = np.array(triple(given.specular_color_factor, np.inf))
    most = color.max()
    even = most - color.min() <= NEARLY * most
    return (1.0, 1.0, 1.0) if even else color_of(color / most)


def _names(whole: Material) -> dict[str, bool]:
    return {
        "clearcoat of glass": whole.clearcoat > 0.0,
        "sheen of glass": max(whole.sheen) > 0.0,
        "color of the specular reflection of glass": min(whole.tint) < 1.0,
    }


def _coated(
    material: Material,
    coat: Clearcoat,
    picture: Picture,
    textures: Textures,
    dropped: list[str],
) -> Material:
    if not coat.clearcoat_factor > 0.0:
        return material
    if coat.clearcoat_normal_texture is not None:
        dropped.append("normal map of clearcoat")
    if coat.clearcoat_texture is not None or coat.clearcoat_roughness_texture is not None:
        dropped.append("map of clearcoat; its mean is used")
    strength = min(coat.clearcoat_factor, 1.0)
    alpha = plain_alpha(coat.clearcoat_roughness_factor)
    return replace(
        material,
        clearcoat=strength * textures.mean(picture(coat.clearcoat_texture), RED),
        clearcoat_alpha=alpha
        * textures.mean(picture(coat.clearcoat_roughness_texture), GREEN, power=2),
    )


def _with_sheen(
    material: Material,
    sheen: Sheen,
    picture: Picture,
    textures: Textures,
    dropped: list[str],
) -> Material:
    color = np.array(color_of(sheen.sheen_color_factor))
    if not color.max() > 0.0:
        return material
    if sheen.sheen_color_texture is not None or sheen.sheen_roughness_texture is not None:
        dropped.append("map of sheen; its mean is used")
    texels = textures.linear(picture(sheen.sheen_color_texture))
    if texels is not None:
        color *= texels.mean(axis=(0, 1), dtype=np.float64)
    alpha = plain_alpha(sheen.sheen_roughness_factor)
    return replace(
        material,
        sheen=color_of(color),
        sheen_alpha=alpha * textures.mean(picture(sheen.sheen_roughness_texture), ALPHA, power=2),
    )
