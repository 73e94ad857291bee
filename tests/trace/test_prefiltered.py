"""The prefiltered panorama against NumPy, and windows as cones see them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.sky import OUTSIDE_ROWS
from iprt.geometry.camera import View
from iprt.trace.voxels import PrefilteredArgs, PrefilteredPanorama, SurroundingsArgs
from tests.kernels.wrap import evaluate
from tests.worlds import Float, panorama_at

OPENING, NONE = 16, 32
"""SURFACE_OPENING and SURFACE_NONE of `cl/lib/world/real/real.h`."""


def block_means(image: Float, rows: int) -> Float:
    """(rows, 2 rows, 3) means of whole blocks of texels, each by its solid angle."""
    height = len(image)
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    weight = (edges[:-1] - edges[1:])[:, None, None] * np.ones((1, 2 * height, 1))
    block = height // rows
    shape = (rows, block, 2 * rows, block, -1)
    sums = (image * weight).reshape(shape).sum((1, 3))
    return np.asarray(sums / weight.reshape(shape).sum((1, 3)))


@pytest.mark.parametrize("openings", [False, True])
def test_levels_are_means_by_solid_angle(device: ComputeDevice, openings: bool) -> None:
    """Also: beside windows and sky the outside is what windows show in those directions."""
    width, height = 1024, 512
    rng = np.random.default_rng(4)
    seen = rng.random((height, width, 3)).astype(np.float32)
    outside = rng.random((OUTSIDE_ROWS, 2 * OUTSIDE_ROWS, 3)).astype(np.float32)
    surface = np.zeros((height, width, 4), np.float32)
    surface[..., 3] = rng.choice([0, 1, OPENING, NONE | 1], (height, width))
    panorama: Any = SimpleNamespace(
        width=width,
        height=height,
        radiated=device.upload("test radiance", seen),
        surface=device.upload("test surface", surface),
        outside=device.upload("test outside", outside),
    )
    prefiltered = PrefilteredPanorama(device, "test prefiltered", openings=openings)
    prefiltered.load(panorama)
    texels = device.read(prefiltered.texels)
    wanted = seen.astype(np.float64)
    if openings:
        shown = (surface[..., 3].astype(int) & (OPENING | NONE)) > 0
        d = View(width, height, projection="equirect").directions()
        wanted = np.where(shown[..., None], wanted, panorama_at(outside, d))
    for columns, rows, first, _ in prefiltered.levels.tolist():
        found = texels[first : first + rows * columns].reshape(rows, columns, 3)
        np.testing.assert_allclose(found, block_means(wanted, rows), atol=1e-3)


def test_windows_show_the_outside_and_gaps_the_panorama(device: ComputeDevice) -> None:
    """Each counts by its share, on top of the room's own light."""
    levels = device.upload("test levels", np.array([[2, 1, 0, 0]], np.int32))
    panorama, outside = np.array([2.0, 3.0, 4.0]), np.array([50.0, 60.0, 70.0])
    texels = {
        name: device.upload(f"test {name}", np.tile(color, 2).astype(np.float32))
        for name, color in (("panorama", panorama), ("outside", outside))
    }
    rng = np.random.default_rng(6)
    room, d = rng.random((8, 3)).astype(np.float32), rng.normal(size=(8, 3)).astype(np.float32)
    shares = rng.random((8, 2)).astype(np.float32)
    shares[0] = 0.0
    found = evaluate(
        device,
        ["trace/prefiltered.h"],
        """
        const Cone cone = {(float3)(0.0f), normalize(d), 0.5f, 0.0f, 0.0f};
        const ConeLight light = {room, shares.x, shares.y, 1.0f, 1.0f};
        arriving = all_arriving(around, cone, light);
        """,
        {"d": d, "room": room, "shares": shares},
        {"arriving": "float3"},
        defines=["OPENING_ENVIRONMENT"],
        parameters="const Surroundings around",
        arguments={
            "around": SurroundingsArgs(
                **{
                    name: PrefilteredArgs(texels=of, levels=levels, count=1)
                    for name, of in texels.items()
                }
            )
        },
    )["arriving"]
    wanted = room + shares[:, :1] * outside + shares[:, 1:] * panorama
    np.testing.assert_allclose(found, wanted, rtol=1e-5)
