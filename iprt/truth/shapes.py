"""Meshes and materials as Mitsuba objects, equivalent to the renderer's."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import NORMAL_MAPS, Material
from iprt.geometry.mesh import Instance, transformed
from iprt.geometry.place import Place
from iprt.truth.backend import mitsuba
from iprt.truth.covered import LEAST_ALPHA, covered

LOG = logging.getLogger("iprt.truth")


class Triangles(Protocol):
    """Indexed triangles with smooth normals and texture coordinates."""

    @property
    def positions(self) -> NDArray[Any]:
        """Positions (V, 3)."""

    @property
    def normals(self) -> NDArray[Any]:
        """Unit normals (V, 3)."""

    @property
    def uvs(self) -> NDArray[Any]:
        """Texture coordinates (V, 2)."""

    @property
    def triangles(self) -> NDArray[Any]:
        """Vertex indices (F, 3)."""


def mitsuba_mesh(mesh: Triangles, bsdf: Any, emitter: Any = None, medium: Any = None) -> Any:
    """Return a Mitsuba mesh in world space, smoothly shaded.

    Parameters
    ----------
    mesh : Triangles
        Positions and normals (V, 3), texture coordinates (V, 2), triangles (F, 3).
    bsdf, emitter, medium : dict or Mitsuba object
        `medium` fills the inside.
    """
    mi = mitsuba()
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf
    if emitter is not None:
        props["emitter"] = mi.load_dict(emitter) if isinstance(emitter, dict) else emitter
    if medium is not None:
        props["interior"] = mi.load_dict(medium)
    shape = mi.Mesh(
        "mesh",
        vertex_count=len(mesh.positions),
        face_count=len(mesh.triangles),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=props,
    )
    params = mi.traverse(shape)
    params["vertex_positions"] = np.ascontiguousarray(mesh.positions, np.float32).ravel()
    params["vertex_normals"] = np.ascontiguousarray(mesh.normals, np.float32).ravel()
    params["vertex_texcoords"] = np.ascontiguousarray(mesh.uvs, np.float32).ravel()
    params["faces"] = np.ascontiguousarray(mesh.triangles, np.uint32).ravel()
    params.update()
    return shape


def bsdf_of(material: Material) -> Any:
    """Return the Mitsuba BSDF of the front side of a virtual object's material, without holes.

    A principled one is a blend of `roughplastic`, whose roughness is the mean of its map, and of
    `principled`, with the layers of `covered`. Where its index of refraction varies, this has the
    mean. Maps of a second set of texture coordinates are read where the color lies.
    """
    color: dict[str, Any] = {"type": "rgb", "value": list(material.albedo)}
    if material.texture is not None:
        color = _bitmap(material.texture * np.array(material.albedo, np.float32))
    if material.normal_texture is not None and not material.has_coat_normal:
        plain = bsdf_of(replace(material, normal_texture=None))
        return {"type": "normalmap", "normalmap": _normals(material, 0), "bsdf": plain}
    if material.kind == "principled":
        return _principled(material, color)
    smooth = material.is_smooth
    if material.kind == "dielectric":
        return _dielectric(material, color)
    if material.kind == "diffuse":
        return {"type": "diffuse", "reflectance": color}
    if material.kind == "conductor":
        metal = {"material": "none", "specular_reflectance": color}
        if smooth:
            return {"type": "conductor", **metal}
        return {
            "type": "roughconductor",
            "distribution": "ggx",
            "alpha": material.alpha,
            **metal,
        }
    coat = {"int_ior": material.ior, "nonlinear": False, "diffuse_reflectance": color}
    if smooth:
        return {"type": "plastic", **coat}
    return {"type": "roughplastic", "distribution": "ggx", "alpha": material.alpha, **coat}


def _dielectric(material: Material, color: dict[str, Any]) -> dict[str, Any]:
    glass = {"int_ior": material.ior, "ext_ior": 1.0, "specular_transmittance": color}
    if material.thin:
        return {"type": "thindielectric", **glass}
    if material.is_smooth:
        return {"type": "dielectric", **glass}
    return {"type": "roughdielectric", "distribution": "ggx", "alpha": material.alpha, **glass}


def _principled(material: Material, color: dict[str, Any]) -> Any:
    surface, alpha = material.maps[1], material.alpha
    metallic: Any = material.metallic
    if surface is not None:
        metallic = metallic * surface[..., :1]
    if material.transmission > 0.0:
        # Light inside meets the opaque share from behind.
        opaque = {"type": "twosided", "bsdf": bsdf_of(replace(material, transmission=0.0))}
        glass = _dielectric(material, color)
        if material.has_coat_normal and (bumps := _normals(material, 0)) is not None:
            glass = {"type": "normalmap", "normalmap": bumps, "bsdf": glass}
        return _mixed(_transmission(material, metallic), opaque, glass, material.places[0])
    if material.is_covered:
        bare = replace(material, clearcoat=0.0, sheen=(0.0, 0.0, 0.0), tint=(1.0, 1.0, 1.0))
        below = bsdf_of(replace(bare, alpha=max(material.alpha, LEAST_ALPHA), variants=None))
        if material.has_coat_normal:
            return covered(material, below, _normals(material, 0), _normals(material, 1))
        return covered(material, below)
    roughness: Any = float(np.sqrt(alpha))
    if surface is not None:
        alpha *= float(np.square(surface[..., 1]).mean())
        roughness = _bitmap(roughness * surface[..., 1:], material.places[0])
    metal = {"type": "principled", "base_color": color, "metallic": 1.0, "roughness": roughness}
    plastic = bsdf_of(Material("plastic", alpha=alpha, ior=material.ior))
    base = plastic | {"diffuse_reflectance": color}
    return _mixed(metallic, base, metal, material.places[0])


def _transmission(material: Material, metallic: Any) -> Any:
    """Return the share of the light that passes, a number or an image (H, W, 1)."""
    share, variants = material.transmission, material.variants
    if variants is None or "transmission" not in variants.names:
        return share * (1.0 - metallic)
    values = [variant.transmission for variant in material.palette]
    shares = np.array(values, np.float32)[variants.index][..., None]
    if isinstance(metallic, np.ndarray):
        rows, columns = (
            np.arange(shares.shape[axis]) * metallic.shape[axis] // shares.shape[axis]
            for axis in (0, 1)
        )
        metallic = metallic[rows[:, None], columns]
    return shares * (1.0 - metallic)


def _mixed(share: Any, first: Any, second: Any, place: Place | None) -> dict[str, Any]:
    """Return a blend with a share of the second, a number or an image (H, W, 1) at a place."""
    weight = _bitmap(share, place) if isinstance(share, np.ndarray) else float(share)
    return {"type": "blendbsdf", "weight": weight, "first": first, "second": second}


def _medium(material: Material) -> dict[str, Any]:
    """Return a medium that absorbs light and scatters none."""
    most = max(material.absorption)
    rgb = {"type": "rgb", "value": [value / most for value in material.absorption]}
    return {"type": "homogeneous", "sigma_t": rgb, "scale": most, "albedo": 0.0}


def _emission(material: Material) -> dict[str, Any]:
    """Return the radiance that a material emits, in Mitsuba only from its front."""
    if material.emission_texture is None:
        return {"type": "rgb", "value": list(material.emission)}
    image = material.emission_texture * np.array(material.emission, np.float32)
    return _bitmap(image, material.places[2])


def _opacity(material: Material) -> Any:
    """Return the opacity after the cutoff, which is applied texel by texel."""
    opacity = material.opacity * np.ones((1, 1), np.float32)
    if material.opacity_texture is not None:
        opacity = material.opacity * material.opacity_texture
    if material.cutoff > 0.0:
        opacity = (opacity >= material.cutoff).astype(np.float32)
    return _bitmap(opacity[..., None])


def _unit(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-9), np.float32)


def _normals(material: Material, number: int) -> dict[str, Any] | None:
    """Return a texture of a material's normals, 0, or of its clear coat's, 1; None without.

    Mitsuba stores vectors as colors, 0.5 (1 + v). Those of the clear coat lie along the tangents of
    the other map.
    """
    image, place = material.maps[NORMAL_MAPS[number]], material.map_places[NORMAL_MAPS[number]]
    if image is None:
        return None
    along = place if number == 0 or material.normal_texture is None else material.places[1]
    return _bitmap(0.5 + 0.5 * _turned(_unit(image), along), place)


def _turned(vectors: NDArray[np.float32], place: Place | None) -> NDArray[np.float32]:
    """Return a normal map's vectors along the mesh's tangents instead of the map's own.

    Mitsuba knows only the former. Exact where texture coordinates keep angles.
    """
    if place is None or place.second or place.scale == 0.0:
        return vectors
    linear = np.array(place.matrix)[:, :2]
    along = np.linalg.inv(linear)[:, 0]
    along /= np.linalg.norm(along)
    across = np.sign(np.linalg.det(linear)) * np.array([-along[1], along[0]])
    level = vectors[..., :2] @ np.stack([along, across])
    return np.concatenate([level, vectors[..., 2:]], axis=-1).astype(np.float32)


def _bitmap(image: NDArray[np.float32], place: Place | None = None) -> dict[str, Any]:
    """Return a texture of linear values, row 0 at v = 1."""
    mi = mitsuba()
    rows = np.ascontiguousarray(image[::-1], np.float32)
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(rows), "raw": True}
    if place is not None and not place.second:
        texture["to_uv"] = mi.ScalarTransform3f([*place.matrix, (0.0, 0.0, 1.0)])
    return texture


def instance_shapes(instances: Sequence[Instance]) -> dict[str, Any]:
    """Return Mitsuba shapes of placed meshes, one per material that triangles use."""
    shapes = {}
    for number, instance in enumerate(instances):
        mesh, to_world = instance.mesh, instance.to_world
        normals = mesh.normals @ np.linalg.inv(to_world[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        positions = transformed(to_world, mesh.positions)
        placed = replace(
            mesh, positions=positions.astype(np.float32), normals=normals.astype(np.float32)
        )
        used = (place for material in mesh.materials for place in material.map_places)
        if any(place is not None and place.second for place in used):
            LOG.warning(
                "%s: the truth shows maps of its second texture coordinates where its color lies",
                instance.name,
            )
        for index, material in enumerate(mesh.materials):
            triangles = mesh.triangles[mesh.material_index == index]
            if len(triangles):
                part = replace(placed, triangles=triangles)
                bsdf = bsdf_of(material)
                if not material.transmits:
                    bsdf = {"type": "twosided", "bsdf": bsdf}
                if material.has_holes:
                    bsdf = {"type": "mask", "opacity": _opacity(material), "bsdf": bsdf}
                emitter = {"type": "area", "radiance": _emission(material)}
                # Mitsuba gives dots in names a meaning of their own.
                shapes[f"object_{number}_{index}"] = mitsuba_mesh(
                    part,
                    bsdf,
                    emitter if material.emits else None,
                    _medium(material) if max(material.absorption) > 0.0 else None,
                )
    return shapes
