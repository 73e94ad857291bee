"""Marking of the texels of glossy surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.device.kept import WORTH_KEEPING, kept
from iprt.footage.frame import Frame
from iprt.footage.real_material import Mask, RealMaterial


class Glossy:
    """A stage that sets `gloss` and `real_materials` of frames.

    Where regions overlap, the last one wins. The places of surfaces are kept while depth stays.
    """

    def __init__(self, materials: tuple[RealMaterial, ...]) -> None:
        self._materials = materials
        self._depth: NDArray[np.float32] | None = None
        self._opening: Mask | None = None
        self._places: list[Mask] = []

    def __call__(self, frame: Frame) -> Frame:
        """Return the frame with its glossy texels marked."""
        if not self._materials:
            return frame
        if frame.depth is not self._depth or frame.opening is not self._opening:
            self._places = places(frame, self._materials, once=self._depth is None)
            self._depth, self._opening = frame.depth, frame.opening
        gloss = np.zeros(frame.depth.shape, np.uint8)
        for index, (material, place) in enumerate(zip(self._materials, self._places, strict=True)):
            gloss[material.colored(frame, place)] = index + 1
        materials = tuple(material.material for material in self._materials)
        return replace(frame, gloss=gloss, real_materials=materials)


def places(frame: Frame, materials: tuple[RealMaterial, ...], *, once: bool) -> list[Mask]:
    """Return `RealMaterial.place` of materials.

    Normals are fitted for it, so that of large panoramas it is kept (`iprt.device.kept`) if `once`.
    """
    if not once or frame.depth.size < WORTH_KEEPING:
        return [material.place(frame) for material in materials]
    inputs = [frame.depth, frame.opening, frame.normal, materials]
    found = kept(
        "places",
        __name__,
        inputs,
        lambda: {str(i): np.packbits(one.place(frame)) for i, one in enumerate(materials)},
    )
    return [
        np.unpackbits(found[str(i)], count=frame.depth.size).reshape(frame.depth.shape).view(bool)
        for i in range(len(materials))
    ]
