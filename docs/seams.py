#!/usr/bin/env python3
"""Measure the flicker at seams of chunks: `python docs/seams.py SCENE VIEW WIDTH HEIGHT [N]`.

For several warm-ups, a film is cut at several frames. The table compares the flicker of relit and
of object pixels around the cuts, after motion compensation, with an uncut film's in the same
frames: with a fade over the second half of the warm-up, and without. It also tells how far the
first picture after a warm-up differs from the uncut film's, in steps of an 8-bit display. N frames
are accumulated.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.film import Film
from iprt.measure.stability import FlickerMeter, Kind, Mask, pixel_kinds
from iprt.output.chunks import Chunks
from iprt.output.display import display
from iprt.renderer import RenderedFrame
from iprt.scene.scene import Scene
from iprt.settings.model import Settings

LAYERS = ("coverage", "ratio", "gloss", "motion")
WARM_UPS = (1, 2, 4, 8, 16)
CUTS = 6
"""Number of cuts, which divide the rest of the video evenly."""
LIT: tuple[Kind, ...] = ("relit", "object")

Picture = NDArray[np.float64]


@dataclass(frozen=True)
class Uncut:
    """A frame of the uncut film: its picture, the kinds of its pixels, and their motion."""

    shown: Picture
    kinds: Mapping[Kind, Mask]
    motion: NDArray[np.float32]

    @classmethod
    def of(cls, picture: RenderedFrame, exposure: float) -> Uncut:
        """Develop a rendered frame."""
        layers, color = picture.aovs, picture.color
        gloss = layers.get("gloss", np.zeros(color.shape[:2], np.float32))
        kinds = pixel_kinds(layers["coverage"], layers["ratio"], gloss)
        return cls(display(color, exposure), kinds, layers["motion"])


def main(folder: str, name: str, width: str, height: str, accumulate: str = "4") -> None:
    """Measure one view of a scene."""
    scene = Scene.open(Path(folder))
    found = scene.views[name]
    view = replace(found, view=found.view.resized(int(width), int(height)))
    device, there = ComputeDevice(choose_device(None), 600.0), scene.frame_indices
    film = Film(scene, device, Settings(), view=view, accumulate=int(accumulate))
    uncut = {
        index: Uncut.of(picture, scene.exposure)
        for index, picture in film.frames(there, warm_up=8, aovs=LAYERS)
    }
    rows = []
    for warm_up in WARM_UPS:
        cuts = np.linspace(there[0] + warm_up + 2, there[-1], CUTS).round().astype(int)
        meters = {"faded": FlickerMeter(), "cut": FlickerMeter()}
        differences = []
        for cut in cuts:
            begin = int(cut) - warm_up
            chunks = Chunks(range(int(cut) + 1), range(int(cut) + 1), int(cut), warm_up)
            after = {
                index: display(picture.color, scene.exposure)
                for index, picture in film.frames(range(begin, cut + 1))
            }
            for index in range(begin - 2, cut + 1):
                frame = uncut[index]
                faded = hard = frame.shown
                if index == cut:
                    faded = hard = after[index]
                    differences.append(np.abs(hard - frame.shown).mean())
                elif index in chunks.tail(0):
                    faded = faded + chunks.share(index) * (after[index] - faded)
                for meter, shown in zip(meters.values(), (faded, hard), strict=True):
                    # Nothing is compared with the cut before.
                    reference = None if index == begin - 2 else frame.shown
                    meter.add(shown, reference, frame.kinds, frame.motion)
        ratios = [meter.result(kind).ratio for meter in meters.values() for kind in LIT]
        rows.append(
            [str(warm_up), *(f"{r:.3f}" for r in ratios), f"{255 * np.mean(differences):.2f}"]
        )
    film.close()
    titles = ["warm-up", *(f"{kind}, {how}" for how in ("faded", "cut") for kind in LIT), "differs"]
    print(f"{scene.name}, {name}, {width}x{height}, {accumulate} accumulated")
    for row in [titles, *rows]:
        print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main(*sys.argv[1:])
