#!/usr/bin/env python3
"""Measure frames in motion: `python docs/motion.py SCENE...` prints a table.

Two motions end in each view that has a truth: a head that turns by one degree a frame, and objects
that move by two centimetres a frame across the picture, each from both sides. The last frame, with
one sample a frame, is compared with the truth and with the same frame converged.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.film import footage_of
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.measure.combinations import still_settings
from iprt.measure.stability import FlickerMeter, pixel_kinds
from iprt.measure.video_stability import SHOWN, over_background
from iprt.measure.view_truth import read_target, views_with_truth
from iprt.output.display import display
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.scene import Scene
from iprt.settings.model import Settings

FRAMES = 24
TURN_DEG, STEP_M = 1.0, 0.02
CONVERGED = 32
FLICKERING = 4
"""Last frames whose changes are compared with the changes of converged pictures."""
MOST_WIDTH = 512

Frames = list[tuple[View, tuple[Instance, ...]]]


class Bench:
    """View of a scene with its truth, in which things move."""

    def __init__(self, device: ComputeDevice, scene: Scene, name: str) -> None:
        target = read_target(scene, name, "truth")
        view = target.view
        if view.width > MOST_WIDTH:
            target = read_target(scene, name, "truth", (view.width // 2, view.height // 2))
        self.device, self.scene, self.target = device, scene, target
        self.frame = scene.frame(target.index)
        self.instances = scene.instances_named(target.objects)

    def renderer(self, view: View, instances: tuple[Instance, ...], settings: Settings) -> Renderer:
        """Return a renderer of the frame."""
        footage = footage_of(self.scene, self.frame, settings)
        return Renderer(self.device, self.frame, instances, view, settings, footage=footage)

    def converged(self, view: View, instances: tuple[Instance, ...]) -> RenderedFrame:
        """Return the picture of things at rest."""
        with self.renderer(view, instances, still_settings(Settings(), 7)) as renderer:
            return renderer.render(CONVERGED, SHOWN)

    def paths(self, kind: str) -> Iterator[Frames]:
        """Yield the frames from either side."""
        view = self.target.view
        for side in (1.0, -1.0):
            frames: Frames = []
            for left in range(FRAMES - 1, -1, -1):
                if kind == "head":
                    turned = replace(view, yaw_deg=view.yaw_deg + side * left * TURN_DEG)
                    frames.append((turned, tuple(self.instances)))
                else:
                    step = side * left * STEP_M * view.world_from_view[:, 0]
                    moved = (shifted(instance, step) for instance in self.instances)
                    frames.append((view, tuple(moved)))
            yield frames

    def row(self, kind: str) -> list[str]:
        """Return the columns of the table."""
        meter, scores, likeness = FlickerMeter(), [], []
        target = self.target
        still = over_background(self.converged(target.view, tuple(self.instances)), target)
        for side, frames in enumerate(self.paths(kind)):
            with self.renderer(*frames[0], Settings(seed=side)) as renderer:
                for number, (view, instances) in enumerate(frames):
                    renderer.look(view)
                    renderer.move(instances)
                    picture = renderer.render(1, SHOWN)
                    if side == 0 and number >= FRAMES - FLICKERING:
                        self._add(meter, picture, view, instances)
            last = over_background(picture, target)
            scores.append(target.score(last).cuts)
            likeness.append(replace(target, radiance=still).score(last).cuts)
        flicker = [meter.result(of) for of in ("relit", "object")]
        return [
            f"{target.scene} {target.name}",
            kind,
            cuts(target.score(still).cuts),
            cuts(np.mean(scores, axis=0)),
            cuts(np.mean(likeness, axis=0)),
            *(f"{255 * one.output:.2f} ({255 * one.reference:.2f})" for one in flicker),
        ]

    def _add(
        self,
        meter: FlickerMeter,
        picture: RenderedFrame,
        view: View,
        instances: tuple[Instance, ...],
    ) -> None:
        aovs = picture.aovs
        kinds = pixel_kinds(aovs["coverage"], aovs["ratio"], aovs["gloss"])
        shown, reference = (
            display(one.color, self.scene.exposure)
            for one in (picture, self.converged(view, instances))
        )
        meter.add(shown, reference, kinds, aovs["motion"])


def shifted(instance: Instance, step: NDArray[np.float64]) -> Instance:
    to_world = instance.to_world.copy()
    to_world[:3, 3] += step
    return replace(instance, to_world=to_world)


def cuts(values: NDArray[np.float64] | tuple[float, ...]) -> str:
    return " / ".join(f"{value:.3f}" for value in values)


def targets(folders: list[str]) -> Iterator[tuple[Scene, str]]:
    for folder in folders:
        scene = Scene.open(Path(folder))
        for name in views_with_truth(scene):
            yield scene, name


def main() -> None:
    device = ComputeDevice(choose_device())
    columns = "view", "moves", "at rest", "in motion", "likeness", "relit", "object"
    print("| " + " | ".join(columns) + " |", "| --- | --- |" + " ---: |" * 5, sep="\n")
    for scene, name in targets(sys.argv[1:]):
        bench = Bench(device, scene, name)
        for kind in ("head", "objects"):
            print("| " + " | ".join(bench.row(kind)) + " |", flush=True)


if __name__ == "__main__":
    main()
