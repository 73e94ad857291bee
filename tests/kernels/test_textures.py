"""Textures as rays read them: beyond their borders, and between texels."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.geometry.sampler import Sampler, Wrap
from iprt.world.objects.mip_levels import color_levels
from iprt.world.objects.texture_tables import texture_table
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


def expected(uv: Float, sampler: Sampler, image: NDArray[np.float32] = IMAGE) -> Float:
    """The image at (u, v), v up, texel by texel."""
    height, width = image.shape[:2]
    at = np.stack([uv[:, 0] * width, (1.0 - uv[:, 1]) * height], axis=-1)
    if sampler.nearest:
        x, y = np.floor(at).astype(int).T
        column, row = texel(x, width, sampler.wrap[0]), texel(y, height, sampler.wrap[1])
        return image[row, column].astype(np.float64)
    low = np.floor(at - 0.5).astype(int)
    part = at - 0.5 - low
    total = np.zeros((len(uv), 3))
    for dy, dx in itertools.product((0, 1), repeat=2):
        column = texel(low[:, 0] + dx, width, sampler.wrap[0])
        row = texel(low[:, 1] + dy, height, sampler.wrap[1])
        weight = np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1])
        total += weight[:, None] * image[row, column]
    return total


def values(device: ComputeDevice, sampler: Sampler, uv: Float, footprint: Float) -> Float:
    """The texture there by the kernel's function, for footprints in texture coordinates."""
    other = Material(texture=np.zeros((2, 2, 3), np.float32))
    material = Material(texture=IMAGE, samplers=(sampler, *[Sampler()] * 4))
    table, texels = texture_table([other, material])
    arguments: dict[str, Any] = {"texels": device.upload("texels", texels)}
    found = evaluate(
        device,
        ["world/objects/objects_bvh.h"],
        "color = object_texture(texels, as_int4(table[3]), uv, footprint).xyz;",
        {"uv": uv.astype(np.float32), "footprint": footprint.astype(np.float32)},
        {"color": "float3"},
        {"table": table},
        ("OBJECTS_BVH", "BVH_STACK=64", "TEXTURES"),
        "__global const half *texels",
        arguments,
    )
    return found["color"].astype(np.float64)


def apart(uv: Float, *images: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Where uv is not between two texels, of which rounding may choose either."""
    sizes = (image.shape[1::-1] for image in images)
    return np.all([np.abs((uv * size) % 1.0 - 0.5).max(axis=-1) < 0.499 for size in sizes], axis=0)


def places() -> Float:
    return rng.uniform(-2.5, 3.5, (3000, 2)).astype(np.float32).astype(np.float64)


both_filters = pytest.mark.parametrize("nearest", [False, True])
all_wraps = pytest.mark.parametrize("wrap", list(itertools.product(WRAPS, WRAPS)))


@both_filters
@all_wraps
def test_texels(device: ComputeDevice, wrap: tuple[Wrap, Wrap], nearest: bool) -> None:
    sampler, uv = Sampler(wrap, nearest=nearest), places()
    uv = uv[apart(uv, IMAGE)]
    found = values(device, sampler, uv, np.zeros(len(uv)))
    np.testing.assert_allclose(found, expected(uv, sampler), atol=2e-5)
    # Magnified, down to a texel in a footprint, to the bit.
    magnified = rng.uniform(0.0, 0.999, len(uv)) / np.sqrt(IMAGE.shape[0] * IMAGE.shape[1])
    np.testing.assert_array_equal(values(device, sampler, uv, magnified), found)


@both_filters
@all_wraps
def test_levels_between_two_texels(
    device: ComputeDevice, wrap: tuple[Wrap, Wrap], nearest: bool
) -> None:
    """Minified, the value lies between those of two levels; the last one has a single texel."""
    sampler, uv = Sampler(wrap, nearest=nearest), places()
    levels = [level[..., :3] for level in color_levels(IMAGE)]
    uv = uv[apart(uv, *levels)]
    number = rng.uniform(0.0, len(levels) + 1.0, len(uv))
    footprint = 2.0**number / np.sqrt(IMAGE.shape[0] * IMAGE.shape[1])
    found = values(device, sampler, uv, footprint)
    number = np.minimum(number, len(levels) - 1.0)
    shown = [expected(uv, sampler, level) for level in levels]
    share = [np.maximum(1.0 - np.abs(number - level), 0.0)[:, None] for level in range(len(levels))]
    np.testing.assert_allclose(found, sum(map(np.multiply, share, shown)), atol=1e-3)
