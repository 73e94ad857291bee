"""Materials of a USD stage: networks around a UsdPreviewSurface.

Specification: "UsdPreviewSurface Specification" of OpenUSD, with its nodes UsdUVTexture,
UsdPrimvarReader and UsdTransform2d.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pxr import Usd, UsdShade

from iprt.files.message_text import printable
from iprt.geometry.place import IDENTITY, Coefficients
from iprt.geometry.sampler import Wrap
from iprt.geometry.usd_data import Color, UsdMaterial, UsdTexture
from iprt.geometry.usd_layers import Layers

SURFACE, TEXTURE, TRANSFORM = "UsdPreviewSurface", "UsdUVTexture", "UsdTransform2d"
READER = "UsdPrimvarReader_"
DISPLAY_COLOR = "displayColor"
WRAPS: Mapping[str, Wrap] = {"clamp": "clamp", "black": "clamp", "mirror": "mirror"}
MAX_CHAIN = 16
"""Most nodes between a texture and the primvar of its coordinates."""
UNREAD_PICTURES = (".exr", ".hdr", ".tx", ".avif")
NORMAL_SCALE, NORMAL_BIAS = (2.0, 2.0, 2.0), (-1.0, -1.0, -1.0)
"""Scale and bias with which a normal map of 8 bits is read."""
Placement = tuple[str, Coefficients]


class Materials:
    """The materials that prims of a stage are bound to, each read once.

    Attributes
    ----------
    read : list of UsdMaterial
    """

    def __init__(self, layers: Layers, time: Any) -> None:
        self.read: list[UsdMaterial] = []
        self.textures: dict[str, None] = {}
        self._layers, self._time = layers, time
        self._index: dict[str, int | None] = {}

    def of(self, prim: Any) -> int | None:
        """Return the index of the material that a prim is bound to; None without one."""
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material:
            return None
        path = str(material.GetPath())
        if path not in self._index:
            self._index[path] = len(self.read)
            self.read.append(self._material(material))
        return self._index[path]

    def _material(self, material: Any) -> UsdMaterial:
        shader, _, _ = material.ComputeSurfaceSource()
        kind = None if not shader else shader.GetIdAttr().Get(self._time)
        if kind != SURFACE:
            name = printable(str(material.GetPrim().GetName()))
            return UsdMaterial(
                color=(0.5, 0.5, 0.5),
                roughness=1.0,
                unread=(f"material {name}, which has no {SURFACE}",),
            )
        return _Surface(shader, self._layers, self._time, self.textures).material()


class _Surface:
    """A UsdPreviewSurface whose inputs are read."""

    def __init__(self, shader: Any, layers: Layers, time: Any, textures: dict[str, None]) -> None:
        self._shader, self._layers, self._time = shader, layers, time
        self._textures = textures
        self._unread: list[str] = []

    def material(self) -> UsdMaterial:
        color, color_texture = self._color("diffuseColor", 0.18)
        vertex_colors = self._reads_display_color("diffuseColor")
        metallic, metallic_texture = self._number("metallic", 0.0)
        roughness, roughness_texture = self._number("roughness", 0.5)
        opacity, opacity_texture = self._number("opacity", 1.0)
        emission, emission_texture = self._color("emissiveColor", 0.0)
        mode = self._value("opacityMode", "transparent")
        if self._value("useSpecularWorkflow", 0) == 1:
            specular, _ = self._color("specularColor", 0.0)
            # The reflectance of a dielectric; a brighter one is a metal's.
            metallic, metallic_texture = float(max(specular) > 0.2), None
            color = specular if metallic else color
            self._unread.append("specular color, except to tell metals")
        clearcoat, clearcoat_texture = self._number("clearcoat", 0.0)
        clearcoat_roughness, clearcoat_roughness_texture = self._number("clearcoatRoughness", 0.01)
        displacement, displaced = self._number("displacement", 0.0)
        if displacement > 0.0 or displaced is not None:
            self._unread.append("displacement")
        if self._number("occlusion", 1.0)[1] is not None:
            self._unread.append("occlusion map")
        return UsdMaterial(
            color=(1.0, 1.0, 1.0) if vertex_colors else color,
            color_texture=color_texture,
            vertex_colors=vertex_colors,
            metallic=metallic,
            metallic_texture=metallic_texture,
            roughness=roughness,
            roughness_texture=roughness_texture,
            ior=self._number("ior", 1.5)[0],
            opacity=opacity,
            opacity_texture=opacity_texture,
            threshold=max(self._number("opacityThreshold", 0.0)[0], 0.0),
            presence=mode == "presence",
            emission=emission,
            emission_texture=emission_texture,
            normal_texture=self._normals(),
            clearcoat=clearcoat,
            clearcoat_texture=clearcoat_texture,
            clearcoat_roughness=clearcoat_roughness,
            clearcoat_roughness_texture=clearcoat_roughness_texture,
            unread=tuple(dict.fromkeys(self._unread)),
        )

    def _source(self, shader: Any, name: str) -> tuple[Any, str, Any]:
        """Return what gives an input its value.

        Returns
        -------
        value : Any
            None where a node gives it, or nothing does.
        output : str
            Name of the node's output.
        node : UsdShade.Shader or None
        """
        given = shader.GetInput(name)
        for attribute in given.GetValueProducingAttributes() if given else ():
            base, kind = UsdShade.Utils.GetBaseNameAndType(attribute.GetName())
            if kind == UsdShade.AttributeType.Output:
                return None, base, UsdShade.Shader(attribute.GetPrim())
            return attribute.Get(self._time), "", None
        return None, "", None

    def _value(self, name: str, default: Any) -> Any:
        value = self._source(self._shader, name)[0]
        return default if value is None else value

    def _number(self, name: str, default: float) -> tuple[float, UsdTexture | None]:
        """Return a number and its texture, of whose scale the number is the factor."""
        value, output, node = self._source(self._shader, name)
        texture = self._texture(name, output, node)
        if texture is not None:
            channel = "r" if texture.channel == "rgb" else texture.channel
            texture = texture.model_copy(update={"channel": channel, "linear": True})
            return texture.scale["rgba".index(channel)], texture
        return _finite(default if value is None else value, default), None

    def _color(self, name: str, default: float) -> tuple[Color, UsdTexture | None]:
        value, output, node = self._source(self._shader, name)
        texture = self._texture(name, output, node)
        if texture is not None:
            if texture.channel != "rgb":
                self._unread.append(f"single channel of a texture as {name}; all are used")
            return texture.scale[:3], texture
        r, g, b = (default,) * 3 if value is None else value
        return (_finite(r, default), _finite(g, default), _finite(b, default)), None

    def _reads_display_color(self, name: str) -> bool:
        node = self._source(self._shader, name)[2]
        return node is not None and self._variable(node) == DISPLAY_COLOR

    def _variable(self, node: Any) -> str | None:
        """Return the name of the primvar that a node reads; None for another node."""
        if not self._kind(node).startswith(READER):
            return None
        return str(self._source(node, "varname")[0] or "")

    def _kind(self, node: Any) -> str:
        return str(node.GetIdAttr().Get(self._time))

    def _normals(self) -> UsdTexture | None:
        _, output, node = self._source(self._shader, "normal")
        texture = self._texture("normal", output, node)
        if texture is None:
            return None
        scale = self._source(node, "scale")[0] or (1.0,) * 4
        bias = self._source(node, "bias")[0] or (0.0,) * 4
        if not _near(scale, NORMAL_SCALE) or not _near(bias, NORMAL_BIAS):
            self._unread.append("scale and bias of a normal map")
        return texture

    def _texture(self, name: str, output: str, node: Any) -> UsdTexture | None:
        """Return the texture that gives an input its value; other nodes are not read."""
        if node is None:
            return None
        kind = self._kind(node)
        if kind != TEXTURE:
            if self._variable(node) != DISPLAY_COLOR or name != "diffuseColor":
                self._unread.append(f"node {printable(kind, 60)} of {name}")
            return None
        file = self._file(node)
        if file is None:
            return None
        bias = self._source(node, "bias")[0]
        if name != "normal" and bias is not None and any(bias):
            self._unread.append(f"bias of the texture of {name}")
        scale = self._source(node, "scale")[0] or (1.0,) * 4
        r, g, b, a = (_finite(value, 1.0) for value in scale)
        coordinates, matrix = self._placement(node)
        return UsdTexture(
            file=file,
            channel=output if output in ("r", "g", "b", "a") else "rgb",
            scale=(r, g, b, a),
            linear=self._source(node, "sourceColorSpace")[0] == "raw",
            wrap=(self._wrap(node, "wrapS"), self._wrap(node, "wrapT")),
            coordinates=coordinates,
            matrix=matrix,
        )

    def _wrap(self, node: Any, name: str) -> Wrap:
        return WRAPS.get(str(self._source(node, name)[0]), "repeat")

    def _file(self, node: Any) -> str | None:
        """Return the name of a texture's file relative to the mesh file's folder."""
        given = node.GetInput("file")
        attributes = given.GetValueProducingAttributes() if given else ()
        for attribute in attributes:
            value = attribute.Get(self._time)
            if value is None or not value.path:
                continue
            if "<UDIM>" in value.path or value.path.lower().endswith(UNREAD_PICTURES):
                self._unread.append(f"texture {printable(value.path, 80)}")
                return None
            # The strongest opinion decides, and names the file relative to its own layer.
            layer = next(spec.layer for spec in attribute.GetPropertyStack(self._time))
            name = self._layers.beside(layer, value.path)
            self._textures[name] = None
            return name
        return None

    def _placement(self, texture: Any) -> Placement:
        """Return the primvar of a texture's coordinates, and their map."""
        matrix, node = IDENTITY, self._source(texture, "st")[2]
        for _ in range(MAX_CHAIN):
            if node is None:
                break
            kind = self._kind(node)
            if kind != TRANSFORM:
                return self._variable(node) or "st", matrix
            matrix = _after(matrix, self._transform(node))
            node = self._source(node, "in")[2]
        return "st", matrix

    def _transform(self, node: Any) -> Coefficients:
        """Return the map of UsdTransform2d: scale, then rotation, then translation."""
        x, y = self._source(node, "scale")[0] or (1.0, 1.0)
        right, up = self._source(node, "translation")[0] or (0.0, 0.0)
        turn = math.radians(_finite(self._source(node, "rotation")[0] or 0.0, 0.0))
        c, s = math.cos(turn), math.sin(turn)
        return (c * x, -s * y, float(right)), (s * x, c * y, float(up))


def _after(outer: Coefficients, inner: Coefficients) -> Coefficients:
    """Return the map that applies `inner`, then `outer`."""
    columns = [*zip(*inner, strict=True)]
    first, second = (
        tuple(
            row[0] * u + row[1] * v + (row[2] if number == 2 else 0.0)
            for number, (u, v) in enumerate(columns)
        )
        for row in outer
    )
    return (first[0], first[1], first[2]), (second[0], second[1], second[2])


def _finite(value: Any, default: float) -> float:
    number = float(value)
    return number if math.isfinite(number) else default


def _near(values: Any, expected: tuple[float, ...]) -> bool:
    return all(abs(value - other) < 0.02 for value, other in zip(values, expected, strict=False))


def stage_time(stage: Any) -> Any:
    """Return the time at which a stage is read: its first."""
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()
