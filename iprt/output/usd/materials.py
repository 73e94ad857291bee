"""Materials as UsdPreviewSurface."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import Gf, Sdf, UsdShade

from iprt.geometry.material import NORMAL_MAPS, Material
from iprt.geometry.place import Place
from iprt.geometry.sampler import PLAIN, Sampler
from iprt.output.usd.pictures import Pictures
from iprt.output.usd.prims import FIRST, SECOND, usable_name

NO_COAT = 1.0
"""Index of refraction of a surface without a specular reflection."""
NORMAL_SCALE, NORMAL_BIAS = (2.0, 2.0, 2.0), (-1.0, -1.0, -1.0, 0.0)
"""Scale and bias that take the levels of a normal map, from 0 to 1, to directions."""
TYPES = Sdf.ValueTypeNames
INPUTS = {
    "diffuseColor": TYPES.Color3f,
    "emissiveColor": TYPES.Color3f,
    "normal": TYPES.Normal3f,
    "opacityMode": TYPES.Token,
}
"""Types of the surface's inputs other than numbers."""
SHEAR = 1e-5
"""Cosine of the angle between the axes of a texture up to which they count as perpendicular."""


class Network:
    """A material prim, its UsdPreviewSurface and the nodes around it."""

    def __init__(self, stage: Any, path: str) -> None:
        self._stage = stage
        self.material = UsdShade.Material.Define(stage, path)
        self._surface = self._node("surface", "UsdPreviewSurface")
        output = self.material.CreateSurfaceOutput()
        output.ConnectToSource(self._surface.ConnectableAPI(), "surface")

    def set(self, name: str, value: Any) -> None:
        """Set an input of the surface to a number, a color or a word."""
        given = Gf.Vec3f(*value) if isinstance(value, tuple) else value
        self._surface.CreateInput(name, INPUTS.get(name, TYPES.Float)).Set(given)

    def connect(self, name: str, node: Any, output: str) -> None:
        """Let a node give an input its value."""
        node.CreateOutput(output, TYPES.Float if len(output) == 1 else TYPES.Float3)
        given = self._surface.CreateInput(name, INPUTS.get(name, TYPES.Float))
        given.ConnectToSource(node.ConnectableAPI(), output)

    def texture(
        self,
        name: str,
        file: str,
        space: str,
        *,
        sampler: Sampler = PLAIN,
        place: Place | None = None,
        scale: tuple[float, ...] = (),
    ) -> Any:
        """Return a new node that reads a picture at a place, times a factor by channel."""
        node = self._node(name, "UsdUVTexture")
        node.CreateInput("file", TYPES.Asset).Set(file)
        node.CreateInput("sourceColorSpace", TYPES.Token).Set(space)
        for key, wrap in zip(("wrapS", "wrapT"), sampler.wrap, strict=True):
            node.CreateInput(key, TYPES.Token).Set(wrap)
        if any(factor != 1.0 for factor in scale):
            factors = (*scale, 1.0)[:4]
            node.CreateInput("scale", TYPES.Float4).Set(Gf.Vec4f(*factors))
        source = self._coordinates(name, place)
        node.CreateInput("st", TYPES.Float2).ConnectToSource(source.ConnectableAPI(), "result")
        return node

    def _coordinates(self, name: str, place: Place | None) -> Any:
        """Return the node that gives a texture its coordinates."""
        transform = None if place is None else transform_of(place)
        primvar = SECOND if place is not None and transform is not None and place.second else FIRST
        reader = self._node(primvar, "UsdPrimvarReader_float2")
        reader.CreateInput("varname", TYPES.String).Set(primvar)
        reader.CreateOutput("result", TYPES.Float2)
        if transform is None:
            return reader
        degrees, scale, offset = transform
        moved = self._node(f"{name}_place", "UsdTransform2d")
        moved.CreateInput("in", TYPES.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        moved.CreateInput("rotation", TYPES.Float).Set(degrees)
        moved.CreateInput("scale", TYPES.Float2).Set(Gf.Vec2f(*scale))
        moved.CreateInput("translation", TYPES.Float2).Set(Gf.Vec2f(*offset))
        moved.CreateOutput("result", TYPES.Float2)
        return moved

    def _node(self, name: str, kind: str) -> Any:
        node = UsdShade.Shader.Define(self._stage, self.material.GetPath().AppendChild(name))
        node.CreateIdAttr(kind)
        return node


def transform_of(place: Place) -> tuple[float, tuple[float, float], tuple[float, float]] | None:
    """Return a place as UsdTransform2d has it; None if that cannot shear as the place does.

    Returns
    -------
    degrees : float
        Of the rotation, after the scale.
    scale, offset : (float, float)
    """
    (a, b, right), (c, d, up) = place.matrix
    size, angle = math.hypot(a, c), math.atan2(c, a)
    along, across = math.cos(angle), math.sin(angle)
    if abs(b * along + d * across) > SHEAR * math.hypot(b, d):
        return None
    return math.degrees(angle), (size, d * along - b * across), (right, up)


class MaterialWriter:
    """Writer of the materials of objects below a prim; each is written once.

    Attributes
    ----------
    lost : dict of str to None
        Properties that UsdPreviewSurface does not have, a phrase each.
    """

    def __init__(self, stage: Any, scope: str, pictures: Pictures) -> None:
        self._stage, self._scope, self._pictures = stage, scope, pictures
        self._written: list[tuple[Material, Any]] = []
        self.lost: dict[str, None] = {}

    def of(self, material: Material, name: str) -> Any:
        """Return the prim of a material; a new one is named after `name`."""
        for known, prim in self._written:
            if known is material:
                return prim
        chosen = usable_name(name, {prim.GetPath().name for _, prim in self._written})
        network = Network(self._stage, f"{self._scope}/{chosen}")
        if any(place is not None and transform_of(place) is None for place in material.map_places):
            self.lost["sheared places of maps; they lie where the color does"] = None
        self._write_color(network, material, chosen)
        self._write_finish(network, material, chosen)
        self._write_light(network, material, chosen)
        self._written.append((material, network.material))
        return network.material

    def _write_color(self, network: Network, material: Material, name: str) -> None:
        """Set color and opacity: light passes through opacity 0, and presence 0 is a hole."""
        node = None
        network.set("diffuseColor", material.albedo)
        if material.texture is not None:
            file = self._pictures.color(f"{name}_color", material.texture, material.opacity_texture)
            scale = (*material.albedo, material.opacity)
            sampler = material.samplers[0]
            node = network.texture("color", file, "sRGB", sampler=sampler, scale=scale)
            network.connect("diffuseColor", node, "rgb")
        if material.transmits:
            share = 1.0 if material.kind == "dielectric" else material.transmission
            network.set("opacity", 1.0 - share)
            for lost, phrase in (
                (material.thin, "thin walls; their glass is solid"),
                (max(material.absorption) > 0.0, "absorption in glass"),
                (material.has_holes, "holes in glass"),
            ):
                if lost:
                    self.lost[phrase] = None
        elif material.has_holes:
            network.set("opacity", material.opacity)
            network.set("opacityMode", "presence")
            network.set("opacityThreshold", material.cutoff)
            if material.opacity_texture is not None:
                network.connect("opacity", node, "a")

    def _write_finish(self, network: Network, material: Material, name: str) -> None:
        """Set what its reflection depends on; roughness is the root of alpha."""
        metallic = {"conductor": 1.0, "principled": material.metallic}.get(material.kind, 0.0)
        matte = material.kind == "diffuse"
        roughness = 1.0 if matte else math.sqrt(material.alpha)
        network.set("ior", NO_COAT if matte else material.ior)
        network.set("roughness", roughness)
        network.set("metallic", metallic)
        surface = material.maps[1]
        if surface is not None:
            file = self._pictures.factors(f"{name}_finish", surface)
            node = network.texture(
                "finish",
                file,
                "raw",
                sampler=material.samplers[1],
                place=material.places[0],
                scale=(1.0, roughness, metallic),
            )
            network.connect("roughness", node, "g")
            network.connect("metallic", node, "b")
        if material.kind == "principled":
            self._write_layers(network, material)
        if material.normal_texture is not None:
            file = self._pictures.normals(f"{name}_normals", material.normal_texture)
            node = network.texture(
                "normals",
                file,
                "raw",
                sampler=material.samplers[2],
                place=material.places[1],
                scale=NORMAL_SCALE,
            )
            node.CreateInput("bias", TYPES.Float4).Set(Gf.Vec4f(*NORMAL_BIAS))
            network.connect("normal", node, "rgb")

    def _write_layers(self, network: Network, material: Material) -> None:
        if material.clearcoat > 0.0:
            network.set("clearcoat", material.clearcoat)
            network.set("clearcoatRoughness", math.sqrt(material.clearcoat_alpha))
        if material.has_coat_normal and not _coat_follows_base(material):
            self.lost["normals of clear coats, which become the base normals"] = None
        if max(material.sheen) > 0.0:
            self.lost["sheen"] = None
        if min(material.tint) < 1.0:
            self.lost["tints of reflections"] = None
        if material.palette:
            self.lost["maps of clearcoat, sheen, tint and transmission; means are used"] = None

    def _write_light(self, network: Network, material: Material, name: str) -> None:
        if not material.emits:
            return
        network.set("emissiveColor", material.emission)
        if material.emission_texture is not None:
            file = self._pictures.color(f"{name}_emission", material.emission_texture)
            node = network.texture(
                "emission",
                file,
                "sRGB",
                sampler=material.samplers[3],
                place=material.places[2],
                scale=material.emission,
            )
            network.connect("emissiveColor", node, "rgb")


def _coat_follows_base(material: Material) -> bool:
    """Return True if the clear coat has the same normals as the surface below."""
    below, above = (material.maps[at] for at in NORMAL_MAPS)
    places = [material.map_places[at] for at in NORMAL_MAPS]
    same = below is not None and above is not None and np.array_equal(below, above)
    return same and places[0] == places[1]


def radiant_material(stage: Any, path: str, file: str) -> Any:
    """Define a material that shows a picture of radiance as it is, and reflects nothing."""
    network = Network(stage, path)
    network.set("diffuseColor", (0.0, 0.0, 0.0))
    network.set("roughness", 1.0)
    network.set("ior", NO_COAT)
    network.connect("emissiveColor", network.texture("radiance", file, "raw"), "rgb")
    return network.material
