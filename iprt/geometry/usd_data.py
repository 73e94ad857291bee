"""Contents of a USD file, as the process that reads it hands them over.

USD itself is imported only by that process (`usd_child.py`). Everything here is plain data.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from iprt.geometry.place import IDENTITY, Coefficients, Place, Places, relative
from iprt.geometry.sampler import Wrap

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

    @property
    def placement(self) -> tuple[str, Coefficients]:
        """Pair of `coordinates` and `matrix`."""
        return self.coordinates, self.matrix


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
            *((self.clearcoat_texture, self.clearcoat_roughness_texture) * (self.clearcoat > 0.0)),
        )
        return [texture for texture in every if texture is not None]

    @property
    def second(self) -> str | None:
        """Name of the coordinates of `Mesh.uvs2`; None if all textures share the first's."""
        base = next((one.coordinates for one in self.textures()), None)
        used = (one.coordinates for one in self._placed() if one is not None)
        return next((name for name in used if name != base), None)

    @property
    def places(self) -> Places:
        """`Material.places`, of meshes whose coordinates lie where the first texture does."""
        first, second, third = map(self._place, self._placed())
        return first, second, third, second

    @property
    def misplaced(self) -> bool:
        """True if some texture is read at the place of another."""
        base = next((one.placement for one in self.textures()), None)
        coat = (self.clearcoat_texture, self.clearcoat_roughness_texture) * (self.clearcoat > 0.0)
        fixed = [one.placement for one in (self.opacity_texture, *coat) if one is not None]
        surface = {one.placement for one in (self.metallic_texture, self.roughness_texture) if one}
        placed = zip(self._placed(), self.places, strict=False)
        own = [one.placement for one, place in placed if one is not None and place is None]
        return len(surface) > 1 or any(one != base for one in fixed + own)

    def _placed(self) -> tuple[UsdTexture | None, ...]:
        """Return the textures that have places of their own."""
        surface = self.metallic_texture or self.roughness_texture
        return surface, self.normal_texture, self.emission_texture

    def _place(self, texture: UsdTexture | None) -> Place | None:
        base = next(iter(self.textures()), None)
        if texture is None or base is None or texture.placement == base.placement:
            return None
        if texture.coordinates != base.coordinates:
            same = texture.coordinates == self.second
            return Place(texture.matrix, second=True) if same else None
        return relative(base.matrix, texture.matrix)


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
