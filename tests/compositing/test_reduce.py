"""The objects' layer reduced to blocks, against a loop over pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pyopencl import cltypes

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.light_view import block_map
from tests.worlds import Float

PLANES = {
    "normal": 3,
    "depth": 1,
    "id": 1,
    "variant": 1,
    "roughness": 1,
    "metallic": 1,
    "albedo": 3,
    "coverage": 1,
    "motion": 2,
}
NOWHERE = -1e9

views = pytest.mark.parametrize(
    ("view", "scale"),
    [
        (View(32, 24, pitch_deg=-40.0), 4),
        (View(33, 23, yaw_deg=20.0, pitch_deg=-50.0), 4),
        (View(30, 20, pitch_deg=-60.0), 3),
        (View(48, 24, projection="equirect"), 4),
    ],
)


def layer(view: View) -> dict[str, Float]:
    """A plane below, of which random pixels are covered; they move right and up."""
    random, shape = np.random.default_rng(3), (view.height, view.width)
    d = view.directions()
    covered = (random.random(shape) < 0.15) & (d[..., 1] < -0.05)
    y, x = np.indices(shape) + 0.5
    motion = np.stack([x - 3.0, y + 2.0], axis=-1)
    return {
        "normal": np.where(covered[..., None], [0.0, 1.0, 0.0], 0.0),
        "depth": np.where(covered, -1.2 / np.minimum(d[..., 1], -0.01), 0.0),
        "id": np.where(covered, random.integers(1, 5, shape), 0.0),
        "variant": random.integers(1, 9, shape).astype(float),
        "roughness": random.random(shape),
        "metallic": random.random(shape),
        "albedo": random.random((*shape, 3)),
        "coverage": np.where(covered, random.uniform(0.1, 1.0, shape), 0.0),
        "motion": np.where(covered[..., None], motion, NOWHERE),
    }


def reduced(
    device: ComputeDevice, view: View, scale: int, full: dict[str, Float]
) -> dict[str, Float]:
    small = view.reduced(scale)
    layouts = [PlaneLayout.of(v) for v in (view, small)]
    arguments: dict[str, Any] = {}
    for name, channels in PLANES.items():
        image = full[name].reshape(view.height, view.width, channels)
        given = layouts[0].padded(np.moveaxis(image, -1, 0)).astype(np.float32)
        arguments[f"full_{name}"] = device.upload(f"full {name}", given)
        arguments[name] = device.zeros(name, layouts[1].shape(channels))
    device.kernel("compositing/reduce.cl", "reduce_objects")(
        (small.width, small.height),
        arguments,
        view=device.upload("view", small.kernel_constants()),
        full_view=device.upload("full view", view.kernel_constants()),
        to_block=cltypes.make_float4(*block_map(view, small)),
        width=small.width,
        height=small.height,
        full_width=view.width,
        full_height=view.height,
    )
    return {
        name: layouts[1].image(device.read(arguments[name]), slice(0, channels))
        for name, channels in PLANES.items()
    }


@views
def test_each_block_shows_its_covered_pixel_nearest_to_the_centre(
    device: ComputeDevice, view: View, scale: int
) -> None:
    full, small = layer(view), view.reduced(scale)
    found = reduced(device, view, scale, full)
    x_scale, y_scale, x_offset, y_offset = block_map(view, small)
    y, x = np.indices((view.height, view.width)) + 0.5
    at = x * x_scale + x_offset, y * y_scale + y_offset
    d = small.directions()
    seen = 0
    for row in range(small.height):
        for column in range(small.width):
            inside = (np.floor(at[0] + 1e-6) == column) & (np.floor(at[1] + 1e-6) == row)
            covered = inside & (full["coverage"] > 0.0)
            block = {name: image[row, column] for name, image in found.items()}
            if not covered.any():
                assert block["depth"] == block["id"] == block["coverage"] == 0.0
                assert (block["motion"] == NOWHERE).all()
                continue
            seen += 1
            apart = np.hypot(at[0] - column - 0.5, at[1] - row - 0.5)
            least = apart[covered].min()
            candidates = np.argwhere(covered & (apart < least + 1e-6))
            pick = min(
                candidates, key=lambda c: abs(full["coverage"][tuple(c)] - block["coverage"])
            )
            for name in ("normal", "id", "variant", "roughness", "metallic", "albedo"):
                np.testing.assert_allclose(block[name], full[name][tuple(pick)], rtol=1e-6)
            assert block["coverage"] == pytest.approx(full["coverage"][tuple(pick)])
            moved = (full["motion"][tuple(pick)] - (pick[::-1] + 0.5)) * (x_scale, y_scale)
            centre = np.array([column + 0.5, row + 0.5])
            np.testing.assert_allclose(block["motion"], centre + moved, atol=1e-4)
            # The plane's own distance along the ray through the block's centre.
            limit = full["depth"][tuple(pick)] * np.array([0.97, 1.03])
            plane = np.clip(-1.2 / min(d[row, column, 1], -1e-6), *limit)
            assert block["depth"] == pytest.approx(plane, rel=1e-4)
    assert seen > 10
