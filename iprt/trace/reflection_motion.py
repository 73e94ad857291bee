"""Motion vectors of reflected and refracted images, which differ from the surfaces' own."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.guide import Guide


class ReflectionMotion:
    """Reprojection of reflections and refractions to the previous picture while objects move."""

    def __init__(self, device: ComputeDevice, guide: Guide, *, glass: bool) -> None:
        """Build the kernel; `glass`: some pixels show surfaces through dielectrics."""
        self._guide = guide
        defines = guide.defines(GLASS=glass, **guide.camera_define)
        self._kernel = device.kernel(
            "trace/reflection_motion.cl", "move_reflections", defines, later=True
        )
        self._moved = device.zeros("reflection motion", guide.layout.shape(2))

    def run(
        self,
        motion: cla.Array,
        roughness: cla.Array,
        hit: cla.Array,
        previous: cla.Array,
        seen: tuple[cla.Array, cla.Array] | None = None,
    ) -> cla.Array:
        """Return 2 planes: previous position of each pixel's image, pixels; -1e9: nowhere.

        Parameters
        ----------
        motion : 2 planes
            Previous position of each pixel's surface, likewise.
        roughness : 1 plane
            GGX alpha.
        hit : 1 plane
            Distance to the reflected surface, metres; negative: on an object, 0: no reflection.
        previous : (16,) float32
            `View.kernel_constants()` of the previous picture.
        seen : (planes, planes) or None
            `SeenThrough.current` and `SeenThrough.previous`; None without glass.
        """
        guide = self._guide
        self._kernel(
            guide.layout.size,
            guide.arguments(),
            guide.camera_argument,
            guide_previous=guide.previous,
            motion=motion,
            roughness=roughness,
            hit=hit,
            seen=None if seen is None else seen[0],
            seen_previous=None if seen is None else seen[1],
            view=previous,
            moved=self._moved,
        )
        return self._moved
