"""The same curve for a path tracer: Mitsuba with Open Image Denoise, on the same machine."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from iprt.measure.compare import scored
from iprt.measure.convergence import Curve, curve
from iprt.measure.target import Radiance, Target, with_frames

if TYPE_CHECKING:
    from iprt.footage.frame import Frame
    from iprt.geometry.mesh import Instance
    from iprt.scene.scene import Scene

QUICK_S = 4.0
"""A picture made in less is made twice, and the shorter time counts: the first may compile."""


def run_mitsuba(
    scene: Scene,
    targets: Sequence[Target],
    counts: Sequence[int],
    *,
    parts: Mapping[str, Any] | None,
    seeds: int,
    seed: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Curve]:
    """A curve per view: samples per pixel, seconds with building the scene and denoising, scores.

    Each picture is rendered anew, as one that asks for so many samples would.

    Parameters
    ----------
    counts : sequence of int
        Samples per pixel.
    parts : mapping or None
        The full geometry of the scene, see `iprt.truth.model`; None: the world that the panorama
        describes.
    seeds, seed : int
        Pictures per count, and the first one's seed.
    progress : callable, optional
        Called with the number of samples per pixel taken so far.
    """
    done = 0
    label = "Mitsuba + OIDN, " + ("panorama" if parts is None else "full geometry")
    for target, frame in with_frames(scene, targets):
        instances = scene.instances_named(target.objects)
        runs: list[list[Any]] = [[] for _ in range(seeds)]
        for count in counts:
            for index, run in enumerate(runs):
                given = (frame, target, instances, parts, count, seed + index)
                seconds, color = _timed(partial(_render, *given))
                run.append((seconds, scored(target, color, f"{label}, {count} samples")))
                done += count
                if progress is not None:
                    progress(done)
        yield curve(target.name, label, counts, runs)


def _timed(render: Callable[[], Radiance]) -> tuple[float, Radiance]:
    times: list[float] = []
    while len(times) < 2:
        start = time.perf_counter()
        color = render()
        times.append(time.perf_counter() - start)
        if times[0] > QUICK_S:
            break
    return min(times), color


def _render(
    frame: Frame,
    target: Target,
    instances: Sequence[Instance],
    parts: Mapping[str, Any] | None,
    count: int,
    seed: int,
) -> Radiance:
    if parts is not None:
        from iprt.truth.model import render_color
        from iprt.truth.shapes import instance_shapes

        everything = {**parts, **instance_shapes(instances)}
        return render_color(everything, target.view, spp=count, seed=seed)
    from iprt.truth.panorama import render_reference

    result = render_reference(frame, instances, target.view, spp=count, seed=seed)
    if target.background is None:
        return result.color
    uncovered = 1.0 - result.coverage[..., None]
    return uncovered * target.background * result.ratio + result.objects
