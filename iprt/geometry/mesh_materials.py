"""Conversion of mesh-file materials to the kinds that are rendered."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.geometry.gltf_materials import from_gltf
from iprt.geometry.gltf_surfaces import GltfMaterial
from iprt.geometry.material import MAX_EMISSION, Material
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.mtl_materials import from_mtl
from iprt.geometry.reflectance import color_of, triple
from iprt.geometry.textures import Textures
from iprt.geometry.usd_data import UsdMaterial
from iprt.geometry.usd_materials import from_usd

DEFAULT_MATERIAL = Material("diffuse", (0.5, 0.5, 0.5))


def has_texture(source: Any) -> bool:
    """Return True if a material of a file (or None) has a texture that is read."""
    if isinstance(source, GltfMaterial | UsdMaterial):
        return bool(source.textures())
    return isinstance(getattr(source, "image", None), Image.Image)


def convert_material(
    source: Any, file: MeshFile, textures: Textures, dropped: list[str]
) -> Material:
    """Convert a material of a file, and append the properties that are lost to `dropped`.

    Parameters
    ----------
    source : GltfMaterial, UsdMaterial, trimesh SimpleMaterial (MTL) or None
    """
    if source is None:
        return DEFAULT_MATERIAL
    if isinstance(source, GltfMaterial):
        return from_gltf(source, file, textures, dropped)
    if isinstance(source, UsdMaterial):
        return from_usd(source, file, textures, dropped)
    return from_mtl(source, textures, dropped)


def tinted(material: Material, color: tuple[float, ...] | None) -> Material:
    """Return a material multiplied by a color, maybe with opacity; None: unchanged."""
    if color is None:
        return material
    if len(color) > 3:
        material = replace(material, opacity=material.opacity * color[3])
    if _is_unlit(material):
        tint = np.multiply(material.emission, color[:3])
        return replace(material, emission=triple(tint, MAX_EMISSION))
    own = (1.0, 1.0, 1.0) if material is DEFAULT_MATERIAL else material.albedo
    return replace(material, albedo=color_of(np.multiply(own, color[:3])))


def colored(material: Material, texture: NDArray[np.float32]) -> Material:
    """Return a material with a texture of colors (H, W, 3), or of colors and opacity (H, W, 4)."""
    rgb = np.ascontiguousarray(texture[..., :3])
    if _is_unlit(material):
        material = replace(material, emission_texture=rgb)
    if texture.shape[2] > 3:
        alpha = np.ascontiguousarray(texture[..., 3])
        return replace(material, texture=rgb, opacity_texture=alpha)
    return material if _is_unlit(material) else replace(material, texture=rgb)


def _is_unlit(material: Material) -> bool:
    return material.emits and max(material.albedo) == 0.0
