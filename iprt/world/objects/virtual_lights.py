"""Lights without geometry, at which rays are aimed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.device.block import Block, Float4s, Floats, Int32
from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.footage.frame import LUMINANCE
from iprt.geometry.light import PROFILE_SHAPE, Light
from iprt.geometry.mesh import Float, Instance

_HEADER = "lib/world/objects/virtual_lights.h"
LIGHT_ROWS = constant(_HEADER, "LIGHT_ROWS")
"""float4 rows per light; the header documents them."""
_KINDS = {
    kind: constant(_HEADER, f"LIGHT_{kind.upper()}") for kind in ("sphere", "rectangle", "sun")
}


@dataclass(kw_only=True)
class VirtualLightsArgs(Block):
    """Lights without geometry (`cl/lib/world/objects/virtual_lights.h`).

    Attributes
    ----------
    rows : (LIGHT_ROWS * count, 4) float32
        Per light, in the axes of the capture centre: `light_rows`.
    profiles : (P, columns) float32
        Tables of `Light.profile`, one below the other.
    count : int
    """

    rows: Float4s
    profiles: Floats
    count: Int32


class VirtualLights:
    """Lights without geometry on the device.

    Parameters
    ----------
    device : ComputeDevice
    instances : sequence of Instance
        Their lights stay the same.
    """

    def __init__(self, device: ComputeDevice, instances: Sequence[Instance]) -> None:
        self._device = device
        self._count = sum(1 for _ in placed_lights(instances))
        tables = [light.profile for light, _ in placed_lights(instances)]
        found = [table for table in tables if table is not None]
        profiles = np.concatenate(found) if found else np.zeros((1, PROFILE_SHAPE[1]), np.float32)
        self._profiles = device.upload("light profiles", profiles)
        self._rows = device.zeros("virtual lights", (LIGHT_ROWS * max(self._count, 1), 4))

    def load(self, instances: Sequence[Instance]) -> None:
        """Update the lights' places."""
        if self._count:
            self._device.write(self._rows, light_rows(instances))

    def arguments(self) -> VirtualLightsArgs:
        """Return the lights for kernels."""
        return VirtualLightsArgs(rows=self._rows, profiles=self._profiles, count=self._count)


def placed_lights(instances: Iterable[Instance]) -> Iterable[tuple[Light, Float]]:
    """Yield the lights without geometry, with their (4, 4) transforms."""
    for instance in instances:
        if instance.mesh.light is not None:
            yield instance.mesh.light, instance.to_world


def light_rows(instances: Iterable[Instance]) -> NDArray[np.float32]:
    """Return the (LIGHT_ROWS * N, 4) table of the lights.

    A transform scales spheres by the length of its first column, and rectangles along each side.
    Intensities stay.
    """
    rows, first = [], 0
    for light, to_world in placed_lights(instances):
        rows.append(_rows(light, to_world, -1 if light.profile is None else first))
        first += 0 if light.profile is None else len(light.profile)
    return np.reshape(rows, (-1, 4)).astype(np.float32)


def _rows(light: Light, to_world: Float, profile: int) -> Float:
    lengths = np.maximum(np.linalg.norm(to_world[:3, :3], axis=0), 1e-30)
    across, upwards, backwards = (to_world[:3, :3] / lengths).T
    scale, offset = 0.0, 1.0
    if light.cone_deg is not None:
        inner, outer = light.cone
        scale = 1.0 / (inner - outer)
        offset = -outer * scale
    extent = np.sin(np.deg2rad(0.5 * light.diameter_deg))
    if light.kind == "sphere":
        extent = light.radius * lengths[0]
    half = 0.5 * np.array(light.size) * lengths[:2]
    rows = np.zeros((LIGHT_ROWS, 4))
    rows[0] = *to_world[:3, 3], extent
    rows[1] = *light.intensity, _KINDS[light.kind]
    rows[2] = *-backwards, profile
    rows[3] = *across, scale
    rows[4] = *upwards, offset
    rows[5] = *half, float(LUMINANCE @ light.intensity), 0.0
    return rows
