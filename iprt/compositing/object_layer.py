"""Nearest surfaces of the objects in the view, as planes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.vectors import int4
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.material_needs import MaterialNeeds
from iprt.raster.layers import ObjectLayers
from iprt.raster.region import Rect

PLANES = (
    "normal",
    "depth",
    "id",
    "variant",
    "roughness",
    "metallic",
    "coat_normal",
    "albedo",
    "coverage",
    "motion",
)
"""Names of the planes of visible surfaces."""


class VisibleSurfaces:
    """Nearest surfaces of the objects, as planes.

    Attributes
    ----------
    normal, depth, id, roughness, albedo, coverage, motion : 3, 1, 1, 1, 3, 1, 2 planes
        See `cl/compositing/unpack.cl`.
    metallic : 1 plane or None
        None without principled materials.
    coat_normal : 2 planes or None
        None if no clear coat has a normal of its own.
    variant : 1 plane or None
        None if no material has variants.
    """

    def __init__(
        self, device: ComputeDevice, layout: PlaneLayout, *, name: str, needs: MaterialNeeds
    ) -> None:
        """Allocate the planes; `name` prefixes their buffers."""
        self.normal = device.zeros(f"{name} normal", layout.shape(3))
        self.depth = device.zeros(f"{name} depth", layout.shape(1))
        self.id = device.zeros(f"{name} id", layout.shape(1))
        self.roughness = device.zeros(f"{name} roughness", layout.shape(1))
        self.metallic: cla.Array | None = None
        if needs.principled:
            self.metallic = device.zeros(f"{name} metallic", layout.shape(1))
        self.coat_normal: cla.Array | None = None
        if needs.coat_normals:
            self.coat_normal = device.zeros(f"{name} coat normal", layout.shape(2))
        self.variant: cla.Array | None = None
        if needs.variants:
            self.variant = device.zeros(f"{name} variant", layout.shape(1))
        self.albedo = device.zeros(f"{name} albedo", layout.shape(3))
        self.coverage = device.zeros(f"{name} coverage", layout.shape(1))
        self.motion = device.zeros(f"{name} motion", layout.shape(2))

    def planes(self, prefix: str = "") -> dict[str, cla.Array | None]:
        """Return all planes by name, as kernel arguments."""
        return {prefix + name: getattr(self, name) for name in PLANES}


class VisibleLayer(VisibleSurfaces):
    """Nearest surfaces in the view, unpacked from a drawn image.

    Attributes
    ----------
    display : (3 to 5, H, W, 4) float32
        The drawn image (`cl/lib/gbuffer/display.h`), as `MaterialNeeds.display_images`.
    emission : 3 planes or None
        Emitted radiance. None if no material emits light.
    sides : (H * W, 2) float32
        Share of either real surface that objects hide, in pixels at depth edges.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        edges: Mapping[str, cla.Array],
        needs: MaterialNeeds,
    ) -> None:
        """Allocate the planes. `edges` is `RealLayer.edges` of the view, filled before this."""
        super().__init__(device, layout, name="object", needs=needs)
        self._device = device
        self._layout = layout
        self.display = device.empty(
            "object display", (needs.display_images, layout.height, layout.width, 4)
        )
        self.emission: cla.Array | None = None
        if needs.emission:
            self.emission = device.zeros("object emission", layout.shape(3))
        self.sides = device.empty("object sides", (layout.height * layout.width, 2))
        self._kernel = device.kernel(
            "compositing/unpack.cl",
            "unpack_objects",
            {"VIEW_EQUIRECT": layout.equirect},
        ).fixed(
            layout.arguments(),
            self.planes(),
            edges,
            display=self.display,
            sides=self.sides,
            emission=self.emission,
        )

    def load(self, layers: ObjectLayers, view: cla.Array, materials: cla.Array) -> None:
        """Upload and unpack layers rasterized with `shade=True`."""
        assert layers.display is not None
        self._device.write(self.display, layers.display)
        self.unpack(view, materials, [Rect(0, 0, *self._layout.size)])

    def unpack(self, view: cla.Array, materials: cla.Array, regions: Sequence[Rect]) -> None:
        """Fill the planes from `display` in the regions that may have changed."""
        for region in regions:
            self._kernel(
                region.viewport[2:], rectangle=int4(region), view=view, materials=materials
            )
