"""Marking of the texels of glossy surfaces."""

from __future__ import annotations

import numpy as np

from iprt.device.kept import WORTH_KEEPING, kept
from iprt.footage.differences import differing
from iprt.footage.frame import Frame
from iprt.footage.normals import WINDOW_REACH
from iprt.footage.real_material import Mask, RealMaterial


class Glossy:
    """A stage that sets `gloss` and `real_materials` of frames.

    Where regions overlap, the last one wins. The places of surfaces are kept while depth stays.
    """

    def __init__(self, materials: tuple[RealMaterial, ...]) -> None:
        self._materials = materials
        self._last: Frame | None = None
        self._places: list[Mask] = []

    def __call__(self, frame: Frame) -> Frame:
        """Return the frame with its glossy texels marked."""
        if not self._materials:
            return frame
        self._follow(frame)
        gloss = np.zeros(frame.depth.shape, np.uint8)
        for index, (material, place) in enumerate(zip(self._materials, self._places, strict=True)):
            gloss[material.colored(frame, place)] = index + 1
        materials = tuple(material.material for material in self._materials)
        return frame.recolored(gloss=gloss, real_materials=materials)

    def _follow(self, frame: Frame) -> None:
        """Find the places of surfaces in the rows whose depth, or normals, have changed."""
        stale = self._stale_rows(frame)
        if self._last is None:
            self._places = first_places(frame, self._materials)
        elif stale.start < stale.stop:
            for material, place in zip(self._materials, self._places, strict=True):
                place[stale] = material.place(frame, stale)
        self._last = frame

    def _stale_rows(self, frame: Frame) -> slice:
        last = self._last
        if last is None or not _alike(last, frame):
            return slice(0, frame.height)
        differ = differing(last.depth, frame.depth) | differing(last.opening, frame.opening)
        if last.normal is not None and frame.normal is not None:
            differ |= differing(last.normal, frame.normal)
        rows = np.flatnonzero(differ.any(axis=1))
        if not len(rows):
            return slice(0, 0)
        low, high = rows[0] - WINDOW_REACH, rows[-1] + WINDOW_REACH + 1
        return slice(max(low, 0), min(high, frame.height))


def _alike(last: Frame, frame: Frame) -> bool:
    """Return whether normals of equal depth are fitted, or taken, alike."""
    given = last.normal is None, frame.normal is None
    return given[0] == given[1] and last.fit_tolerance == frame.fit_tolerance


def first_places(frame: Frame, materials: tuple[RealMaterial, ...]) -> list[Mask]:
    """Return `RealMaterial.place` of materials, which is kept for large panoramas.

    Normals are fitted for it, which takes long.
    """
    if frame.depth.size < WORTH_KEEPING:
        return [material.place(frame) for material in materials]
    inputs = [frame.depth, frame.opening, frame.normal, frame.fit_tolerance, materials]
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
