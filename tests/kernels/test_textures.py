"""Textures as rays read them: beyond their borders, and between texels."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material, Sampler, Wrap
from iprt.world.objects.object_bvh import texture_table
from tests.kernels.wrap import evaluate

Float = NDArray[np.float64]
WRAPS: tuple[Wrap, ...] = ("repeat", "clamp", "mirror")
SHAPE = (5, 3)
rng = np.random.default_rng(3)
IMAGE = rng.random((*SHAPE, 3)).astype(np.float16).astype(np.float32)


def texel(index: NDArray[np.integer], size: int, wrap: Wrap) -> NDArray[np.integer]:
    """Return the texel that stands at any index (Khronos glTF 2.0, section 3.8.4.4)."""
    if wrap == "clamp":
        return np.clip(index, 0, size - 1)
    if wrap == "mirror":
        there = index % (2 * size)
        return np.where(there < size, there, 2 * size - 1 - there)
    return index % size


def expected(uv: Float, sampler: Sampler) -> Float:
    """The image at (u, v), v up, texel by texel."""
    height, width = SHAPE
    at = np.stack([uv[:, 0] * width, (1.0 - uv[:, 1]) * height], axis=-1)
    if sampler.nearest:
        x, y = np.floor(at).astype(int).T
        column, row = texel(x, width, sampler.wrap[0]), texel(y, height, sampler.wrap[1])
        return IMAGE[row, column].astype(np.float64)
    low = np.floor(at - 0.5).astype(int)
    part = at - 0.5 - low
    total = np.zeros((len(uv), 3))
    for dy, dx in itertools.product((0, 1), repeat=2):
        column = texel(low[:, 0] + dx, width, sampler.wrap[0])
        row = texel(low[:, 1] + dy, height, sampler.wrap[1])
        weight = np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1])
        total += weight[:, None] * IMAGE[row, column]
    return total


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize("wrap", list(itertools.product(WRAPS, WRAPS)))
def test_texels(device: ComputeDevice, wrap: tuple[Wrap, Wrap], nearest: bool) -> None:
    sampler = Sampler(wrap, nearest=nearest)
    other = Material(texture=np.zeros((2, 2, 3), np.float32))
    material = Material(texture=IMAGE, samplers=(sampler, Sampler(), Sampler(), Sampler()))
    table, texels = texture_table([other, material])
    uv = rng.uniform(-2.5, 3.5, (3000, 2)).astype(np.float32)
    # Rounding may choose either texel where two meet.
    apart = np.abs((uv * SHAPE[::-1]) % 1.0 - 0.5).max(axis=-1) < 0.499
    uv = uv[apart]
    arguments: dict[str, Any] = {"texels": device.upload("texels", texels)}
    found = evaluate(
        device,
        ["world/objects/objects_bvh.h"],
        "color = object_texture(texels, as_int4(table[3]), uv).xyz;",
        {"uv": uv},
        {"color": "float3"},
        {"table": table},
        ("OBJECTS_BVH", "BVH_STACK=64"),
        "__global const half *texels",
        arguments,
    )["color"]
    np.testing.assert_allclose(found, expected(uv.astype(np.float64), sampler), atol=2e-5)
