"""Contents of a USD file, as the process that reads it hands them over.

USD itself is imported only by that process (`usd_child.py`). Everything here is plain data.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from iprt.geometry.gltf_surfaces import IDENTITY, Coefficients
from iprt.geometry.material import Wrap

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
Color = tuple[float, float, float]


class _Plain(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class UsdTexture(_Plain):
    """A picture that an input of a material reads (UsdUVTexture).

    Attributes
    ----------
    file : str
        Name relative to the folder of the mesh file, or inside of the package.
    channel : {"rgb", "r", "g", "b", "a"}
    scale : four floats
        Factors of red, green, blue and alpha.
    linear : bool
        True if values are stored linearly, not as sRGB.
    wrap : (Wrap, Wrap)
    coordinates : str
        Name of the primvar with texture coordinates.
    matrix : Coefficients
        Map of texture coordinates, v up.
    """

    file: str
    channel: str = "rgb"
    scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    linear: bool = False
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    coordinates: str = "st"
    matrix: Coefficients = IDENTITY


class UsdMaterial(_Plain):
    """The inputs of a UsdPreviewSurface that are read, each with its texture.

    Attributes
    ----------
    vertex_colors : bool
        True if the color is the primvar `displayColor`.
    threshold : float
        Opacity from which the surface is there; 0: none.
    presence : bool
        True if opacity is the share of the surface that is there, not of light that it lets pass.
    unread : tuple of str
        Properties that are not read, a phrase each.
    """

    color: Color = (0.18, 0.18, 0.18)
    color_texture: UsdTexture | None = None
    vertex_colors: bool = False
    metallic: float = 0.0
    metallic_texture: UsdTexture | None = None
    roughness: float = 0.5
    roughness_texture: UsdTexture | None = None
    ior: float = 1.5
    opacity: float = 1.0
    opacity_texture: UsdTexture | None = None
    threshold: float = 0.0
    presence: bool = False
    emission: Color = (0.0, 0.0, 0.0)
    emission_texture: UsdTexture | None = None
    normal_texture: UsdTexture | None = None
    clearcoat: float = 0.0
    clearcoat_texture: UsdTexture | None = None
    clearcoat_roughness: float = 0.01
    clearcoat_roughness_texture: UsdTexture | None = None
    unread: tuple[str, ...] = ()

    def textures(self) -> list[UsdTexture]:
        """Return the textures; the color's comes first."""
        every = (
            self.color_texture,
            self.metallic_texture,
            self.roughness_texture,
            self.opacity_texture,
            self.emission_texture,
            self.normal_texture,
        )
        return [texture for texture in every if texture is not None]


class Placed(_Plain):
    """A geometry in the world: indices of its arrays and of its material, if it has one."""

    geometry: int
    material: int | None = None


class UsdContents(_Plain):
    """The contents of a USD file, apart from arrays.

    Attributes
    ----------
    materials : list of UsdMaterial
    placed : list of Placed
        In the order of the array `matrices`.
    layers, textures : list of str
        Other files that the file refers to, relative to its folder.
    unread : list of str
        Contents that are not read, a phrase each.
    error : str or None
        Why the file could not be read; all else is then empty.
    """

    materials: list[UsdMaterial] = Field(default=[])
    placed: list[Placed] = Field(default=[])
    layers: list[str] = Field(default=[])
    textures: list[str] = Field(default=[])
    unread: list[str] = Field(default=[])
    error: str | None = None
