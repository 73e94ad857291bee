"""A glTF model for each parameter, map and extension, of the materials in docs/materials.md."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from docs.material_rows import ROWS
from iprt.geometry.material import Material
from iprt.geometry.variants import Variants
from tests.geometry.gltf_files import GltfFile

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
UVS = [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [1.0, 0.0]]
TRIANGLES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
DISTANCE = 0.1
"""Attenuation distance in metres."""


LEAST_REFLECTANCE = 0.04
"""Of the index of refraction 1.5."""
INDEX = np.array([[0, 1, 2, 0], [2, 0, 1, 0]], np.uint8)
"""Map of three values."""
BASE = Material(
    "principled",
    (0.5, 0.25, 0.125),
    alpha=0.25,
    metallic=0.5,
    clearcoat=1.0,
    clearcoat_alpha=0.04,
    sheen=(1.0, 1.0, 1.0),
    sheen_alpha=0.16,
    thin=True,
)
LAYERS = {
    "clearcoat": ("clearcoat", "clearcoatFactor", "clearcoatTexture", "r"),
    "clearcoat_alpha": ("clearcoat", "clearcoatRoughnessFactor", "clearcoatRoughnessTexture", "g"),
    "sheen": ("sheen", "sheenColorFactor", "sheenColorTexture", "rgb"),
    "sheen_alpha": ("sheen", "sheenRoughnessFactor", "sheenRoughnessTexture", "a"),
    "ior": ("specular", "specularFactor", "specularTexture", "a"),
    "tint": ("specular", "specularColorFactor", "specularColorTexture", "rgb"),
    "transmission": ("transmission", "transmissionFactor", "transmissionTexture", "r"),
}
"""Extension, factor, texture and its channels, by attribute of `Material`."""


def ior_of(strength: float) -> float:
    """Return the index of refraction of a share of the reflectance of 1.5."""
    root = np.sqrt(LEAST_REFLECTANCE * strength)
    return float((1.0 + root) / (1.0 - root))


MAPS: dict[str, tuple[Any, Any, Any]] = {
    "clearcoat": (0.0, 0.4, 1.0),
    "clearcoat_alpha": (0.04, 0.36, 1.0),
    "sheen": ((1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (1.0, 1.0, 1.0)),
    "sheen_alpha": (0.04, 0.36, 1.0),
    "ior": (ior_of(0.2), ior_of(0.6), ior_of(1.0)),
    "tint": ((1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (1.0, 1.0, 1.0)),
    "transmission": (0.0, 0.4, 1.0),
}
"""Values of a map of each attribute: levels of 8 bits."""


def with_map(*names: str) -> Material:
    """Return a material with a map of some attributes."""
    rows = tuple(zip(*(MAPS[name] for name in names), strict=True))
    return replace(BASE, variants=Variants(names, rows, INDEX))


def models() -> Iterator[tuple[str, Material]]:
    """Return the materials that glTF has, by name."""
    for row in ROWS:
        for number, material in enumerate(row.materials):
            if material.kind != "conductor":
                yield f"{row.name}-{number}", material


def write_model(path: Path, material: Material) -> Path:
    """Write a tetrahedron of the material: glass has an inside."""
    file = GltfFile()
    coordinates = file.array(UVS)
    mesh = file.mesh(CORNERS, TRIANGLES, TEXCOORD_0=coordinates)
    file.document["meshes"][mesh]["primitives"][0]["material"] = 0
    file.document.update(textures=[], images=[])
    file.document["materials"] = [described(file, material)]
    file.node(mesh=mesh)
    return file.write(path)


def described(file: GltfFile, material: Material) -> dict[str, Any]:
    """Return the material as glTF describes it; its images go to the file."""
    glass = material.kind == "dielectric"
    roughness = 1.0 if material.kind == "diffuse" else np.sqrt(material.alpha)
    pbr: dict[str, Any] = {
        "baseColorFactor": [*material.albedo, material.opacity],
        "metallicFactor": material.metallic,
        "roughnessFactor": float(roughness),
    }
    entry: dict[str, Any] = {"pbrMetallicRoughness": pbr}
    if material.texture is not None:
        pixels = srgb(material.texture)
        if material.opacity_texture is not None:
            opacity = np.rint(255.0 * material.opacity_texture)[..., None]
            pixels = np.concatenate([pixels, opacity.astype(np.uint8)], axis=2)
        pbr["baseColorTexture"] = image(file, pixels)
    if material.surface_texture is not None:
        metal, rough = np.moveaxis(np.rint(255.0 * material.surface_texture), 2, 0)
        pixels = np.stack([0 * metal, rough, metal], axis=-1).astype(np.uint8)
        pbr["metallicRoughnessTexture"] = image(file, pixels)
    if material.normal_texture is not None:
        pixels = np.rint(127.5 * (1.0 + material.normal_texture)).astype(np.uint8)
        entry["normalTexture"] = image(file, pixels)
    if material.has_holes:
        entry["alphaMode"] = "MASK" if material.cutoff > 0.0 else "BLEND"
        entry["alphaCutoff"] = material.cutoff
    extensions: dict[str, Any] = {"ior": {"ior": material.ior}}
    if (strength := max(material.emission)) > 0.0:
        entry["emissiveFactor"] = [value / strength for value in material.emission]
        extensions["emissive_strength"] = {"emissiveStrength": strength}
        if material.emission_texture is not None:
            entry["emissiveTexture"] = image(file, srgb(material.emission_texture))
    if material.transmits:
        extensions["transmission"] = {"transmissionFactor": 1.0 if glass else material.transmission}
        if not material.thin:
            passed = np.exp(-DISTANCE * np.array(material.absorption)).tolist()
            extensions["volume"] = {
                "thicknessFactor": 0.01,
                "attenuationColor": passed,
                "attenuationDistance": DISTANCE,
            }
    if material.clearcoat > 0.0:
        extensions["clearcoat"] = {
            "clearcoatFactor": material.clearcoat,
            "clearcoatRoughnessFactor": np.sqrt(material.clearcoat_alpha),
        }
        if material.clearcoat_normal_texture is not None:
            pixels = np.rint(127.5 * (1.0 + material.clearcoat_normal_texture)).astype(np.uint8)
            extensions["clearcoat"]["clearcoatNormalTexture"] = image(file, pixels)
    if max(material.sheen) > 0.0:
        extensions["sheen"] = {
            "sheenColorFactor": material.sheen,
            "sheenRoughnessFactor": np.sqrt(material.sheen_alpha),
        }
    if material.tint != (1.0, 1.0, 1.0):
        extensions["specular"] = {"specularColorFactor": material.tint}
    if material.variants is not None:
        extensions["ior"] = {"ior": 1.5}
        for extension, keys in layer_maps(file, material.variants).items():
            extensions[extension] = extensions.get(extension, {}) | keys
    entry["extensions"] = {f"KHR_materials_{name}": given for name, given in extensions.items()}
    return entry


def layer_maps(file: GltfFile, variants: Variants) -> dict[str, dict[str, Any]]:
    """Return the keys of extensions that have the maps of variants, with factors of 1."""
    extensions: dict[str, dict[str, Any]] = {}
    for name, values in zip(variants.names, zip(*variants.values, strict=True), strict=True):
        extension, factor, texture, channels = LAYERS[name]
        levels = np.array(values, np.float64)
        if name == "ior":
            levels = ((levels - 1.0) / (levels + 1.0)) ** 2 / LEAST_REFLECTANCE
        elif name.endswith("alpha"):
            levels = np.sqrt(levels)
        stored = srgb(levels) if channels == "rgb" else np.rint(255.0 * levels).astype(np.uint8)
        pixels = np.full((*variants.index.shape, 4), 255, np.uint8)
        for place in channels:
            value = stored[:, channels.index(place)] if channels == "rgb" else stored
            pixels[..., "rgba".index(place)] = value[variants.index]
        one = [1.0, 1.0, 1.0] if channels == "rgb" else 1.0
        keys = {factor: one, texture: image(file, pixels)}
        extensions[extension] = extensions.get(extension, {}) | keys
    return extensions


def image(file: GltfFile, pixels: np.ndarray) -> dict[str, int]:
    """Add an image (H, W, 3 or 4) uint8, and return the reference to its texture."""
    with BytesIO() as stream:
        Image.fromarray(pixels).save(stream, "PNG")
        stored = np.frombuffer(stream.getvalue(), np.uint8)
    view = file.document["accessors"][file.array(stored[:, None], "u1")]["bufferView"]
    file.document["images"].append({"bufferView": view, "mimeType": "image/png"})
    file.document["textures"].append({"source": len(file.document["images"]) - 1})
    return {"index": len(file.document["textures"]) - 1}


def srgb(linear: np.ndarray) -> np.ndarray:
    """Encode linear values."""
    curve = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255.0 * curve), np.uint8)
