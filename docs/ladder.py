#!/usr/bin/env python3
"""Measure what the viewers' target frame rate gives up: `python docs/ladder.py [DEVICE]`.

Writes `iprt/viewer/ladder.json`. Every setting is turned down by itself, from the best preset, on
the views of `scenes360/room`; then all of them, one notch after another, those first that save most
time for the SSIM that they cost. The rungs that are both slower and worse than another are left
out, and so are settings that compile kernels when they are turned. SSIM is the mean of the views'
cuts, after as many frames as a quarter of a second holds; of a small picture, when it is shown as
large as the others. It takes some five minutes on two cores; let nothing else run meanwhile.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import pyopencl as cl
from skimage.transform import resize

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.files.atomic import replacing
from iprt.footage.frame import Frame
from iprt.measure import metrics
from iprt.measure.camera_motion import Turn
from iprt.measure.pareto import pareto_front
from iprt.measure.sweep import still_settings
from iprt.measure.target import Target, read_target, views_with_truth
from iprt.output.display import display
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.settings.overrides import changed, resolved
from iprt.viewer.ladder import FILE, SCALE, Ladder, MeasuredRung, MeasuredSetting, order_of_notches

ROOT = Path(__file__).resolve().parents[1]
TOP = "accurate"
SIZE = (256, 256)
FRAMES = 8
NOTCHES: dict[str, tuple[Any, ...]] = {
    "trace.rays": (1,),
    "trace.object_rays": (4, 2, 1),
    "trace.bounces": (2, 1),
    "iprt.relight_reflections": (False,),
    "iprt.ratio_rows": (64, 16),
    "trace.jitter": (False,),
    "trace.light_sampling": (False,),
    "irradiance.rows": (128, 64),
    "irradiance.rays": (1,),
    "atrous.levels": (3, 2),
    SCALE: (0.71, 0.5, 0.35, 0.25),
}


@dataclass
class Bench:
    """Measures settings on all views."""

    device: ComputeDevice
    scene: Scene
    frame: Frame
    targets: list[Target]

    def programs(self, changes: dict[str, Any]) -> int:
        """How many are compiled when a renderer at the top changes to this."""
        built = []
        for given in ({}, changes):
            for target in self.targets:
                view = target.view.resized(16, 16)
                objects = self.scene.instances_named(target.objects)
                with Renderer(self.device, self.frame, objects, view, settings(given)) as renderer:
                    renderer.step()
            built.append(len(self.device.built_programs))
        return built[1] - built[0]

    def measure(self, changes: dict[str, Any]) -> tuple[float, float]:
        """Milliseconds of a frame of a head that turns, and SSIM; means of the views."""
        times, found = [], []
        for target in self.targets:
            objects = self.scene.instances_named(target.objects)
            goal = small(target, changes)
            chosen = still_settings(settings(changes), 0)
            with Renderer(
                self.device, self.frame, objects, goal.view, chosen, background=goal.background
            ) as renderer:
                color = renderer.render(FRAMES).color
                renderer.background = None
                times.append(self.turning_ms(renderer))
            shown = resize(display(color, target.exposure), target.shown.shape, order=1)
            found += metrics.ssim_cuts(np.clip(shown, 0.0, 1.0), target.shown, target.cuts)
        return fmean(times), fmean(found)

    def turning_ms(self, renderer: Renderer) -> float:
        """Milliseconds of the quickest frame: what else runs only ever adds to it.

        On a processor, its own time on all cores, to which that adds next to nothing.
        """
        clock = (
            time.process_time if self.device.device.type & cl.device_type.CPU else time.perf_counter
        )
        reel, times = Turn(self.frame, (), renderer.view, renderer.settings), []
        with reel.steps(self.device, FRAMES) as steps:
            for step in steps:
                start = clock()
                step(renderer)
                renderer.step()
                self.device.wait()
                times.append(1e3 * (clock() - start))
        return min(times)


def settings(changes: dict[str, Any]) -> Settings:
    return changed(resolved(TOP), {k: v for k, v in changes.items() if k != SCALE})


def small(target: Target, changes: dict[str, Any]) -> Target:
    """The target at the resolution of a rung."""
    scale = changes.get(SCALE, 1.0)
    if scale == 1.0:
        return target
    width, height = (round(scale * n) for n in (target.view.width, target.view.height))
    behind = resize(target.background, (height, width, 3), order=1, anti_aliasing=True)
    view = target.view.resized(width, height)
    return replace(target, view=view, background=behind.astype(np.float32))


def measure(bench: Bench) -> Ladder:
    compiling = {}
    for key, values in NOTCHES.items():
        if key != SCALE and (programs := bench.programs({key: values[0]})):
            compiling[key] = programs
    say(f"compile kernels: {compiling}")
    bench.measure({})  # drivers finish kernels when these first run
    top = bench.measure({})
    say(f"top: {top[0]:.1f} ms, SSIM {top[1]:.4f}")
    notches: dict[str, list[MeasuredSetting]] = {}
    for key, values in NOTCHES.items():
        for value in values if key not in compiling else ():
            share, cost = measured(bench, {key: value}, top)
            setting = MeasuredSetting(key=key, value=value, ms_share=share, ssim_cost=cost)
            notches.setdefault(key, []).append(setting)
    changes: dict[str, Any] = {}
    rungs = []
    for notch in order_of_notches(notches):
        changes = {**changes, notch.key: notch.value}
        share, cost = measured(bench, changes, top)
        rungs.append(MeasuredRung(changes=changes, ms_share=share, ssim_cost=cost))
    # The top is no rung, but what is slower and worse than it is none, either.
    marks = pareto_front([(1.0, 0.0), *((rung.ms_share, rung.ssim_cost) for rung in rungs)])[1:]
    return Ladder(
        device=bench.device.name,
        date=date.today().isoformat(),
        scene=bench.scene.name,
        views=tuple(target.name for target in bench.targets),
        size=SIZE,
        quality=TOP,
        ms=round(top[0], 1),
        ssim=round(top[1], 4),
        compiling=compiling,
        settings=tuple(setting for found in notches.values() for setting in found),
        rungs=tuple(rung for rung, mark in zip(rungs, marks, strict=True) if mark),
    )


def measured(
    bench: Bench, changes: dict[str, Any], top: tuple[float, float]
) -> tuple[float, float]:
    """Share of the top's time, and SSIM below it."""
    ms, ssim = bench.measure(changes)
    share, cost = ms / top[0], top[1] - ssim
    say(f"{changes}: {share:.3f} of the time, {-cost:+.4f} SSIM")
    return round(share, 4), round(cost, 4)


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main(device: str | None = None) -> None:
    scene = Scene.open(ROOT / "scenes360" / "room")
    targets = [read_target(scene, name, "truth", SIZE) for name in views_with_truth(scene)]
    chosen = ComputeDevice(choose_device(device))
    ladder = measure(Bench(chosen, scene, scene.frame(), targets))
    with replacing(ROOT / "iprt" / "viewer" / FILE) as temporary:
        temporary.write_text(ladder.model_dump_json(indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:2])
