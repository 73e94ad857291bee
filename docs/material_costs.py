"""Price of each lobe of materials, for docs/materials.md."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import median

import iprt
from docs.material_rows import GLASS, METAL, MIXED, PLASTIC, checks, ripples
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer

SIZE = 256
VIEW = View(SIZE, SIZE, 3.3, -34.7, 30.0)
WARM, MEASURED = 6, 24
TURN_DEG = 0.5

LOBES: Mapping[str, Material] = {
    "diffuse": Material("diffuse", (0.5,) * 3),
    "metal": METAL,
    "mirror": replace(METAL, alpha=0.0),
    "mixture of plastic and metal": replace(MIXED, metallic=0.5),
    "map of albedo": replace(PLASTIC, texture=checks(6, (0.5,) * 3, (0.2,) * 3)),
    "map of metalness and roughness": replace(MIXED, surface_texture=checks(6, (1, 1), (0, 1))),
    "normal map": replace(PLASTIC, normal_texture=ripples()),
    "half opacity": replace(PLASTIC, opacity=0.5),
    "emission": replace(PLASTIC, emission=(1.0, 0.7, 0.3)),
    "smooth glass": GLASS,
    "rough glass": replace(GLASS, alpha=0.2),
    "glass that absorbs": replace(GLASS, absorption=(2.0, 4.0, 8.0)),
    "half transmission": replace(MIXED, transmission=0.5),
    "clearcoat": replace(MIXED, metallic=0.5, clearcoat=1.0, clearcoat_alpha=0.02),
    "sheen": replace(MIXED, sheen=(0.5,) * 3),
}
"""Materials whose frames are timed, by turns with `PLASTIC`."""


def frame_ms(renderer: Renderer, number: int) -> float:
    """Return the time of a frame of a head that turns to and fro."""
    turn = TURN_DEG * (1 if number % 4 in (1, 2) else 0)
    start = time.perf_counter()
    renderer.look(replace(VIEW, yaw_deg=VIEW.yaw_deg + turn))
    renderer.render(1)
    return 1e3 * (time.perf_counter() - start)


def costs(
    device: iprt.ComputeDevice, frame: Frame, balls: Sequence[Instance], plain: Instance
) -> list[tuple[float, float]]:
    """Return the medians of the times of frames with each ball and with `plain`, by turns; ms."""
    found = []
    with Renderer(device, frame, (plain,), VIEW, iprt.Settings()) as beside:
        for ball in balls:
            times: tuple[list[float], list[float]] = [], []
            with Renderer(device, frame, (ball,), VIEW, iprt.Settings()) as renderer:
                for number in range(WARM + MEASURED):
                    for one, spent in zip((renderer, beside), times, strict=True):
                        spent.append(frame_ms(one, number))
            found.append((median(times[0][WARM:]), median(times[1][WARM:])))
    return found
