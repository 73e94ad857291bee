"""Directions towards objects' boxes have the density that is stated for them."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from tests.kernels.wrap import evaluate
from tests.world.real.lighting import numbers
from tests.world.real.sphere import Bins, agreement, even_directions

Float = NDArray[np.float64]

UP = (0.0, 1.0, 0.0)
NEAR = ((-0.2, 0.1, -1.3), (0.3, 0.5, -0.8))
FLAT = ((0.1, 0.05, -0.4), (0.9, 0.07, 0.5))
FAR = ((4.0, 1.0, -6.0), (4.4, 1.5, -5.5))
OVER = ((-0.1, 0.3, -1.1), (0.6, 0.9, -0.5))
LOW = ((-1.0, -0.8, 0.3), (0.2, 0.4, 1.0))
AROUND = ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))

Corners = tuple[tuple[float, float, float], tuple[float, float, float]]
Place = tuple[float, float, float]

CASES: dict[str, tuple[list[Corners], Place, Place]] = {
    "one": ([NEAR], (0.6, -0.2, 0.3), UP),
    "far": ([FAR], (0.0, 0.0, 0.0), UP),
    "two that overlap": ([NEAR, OVER], (0.1, -0.1, 0.2), UP),
    "apart": ([NEAR, FAR, FLAT], (0.3, -0.5, 0.1), UP),
    "near a face": ([FLAT], (0.5, 0.045, 0.1), UP),
    "near an edge": ([NEAR], (-0.205, 0.6, -1.0), (0.6, 0.8, 0.0)),
    "inside one of them": ([AROUND, NEAR, LOW], (0.1, 0.2, -0.3), (0.0, 0.6, -0.8)),
    "cut by the horizon": ([LOW, NEAR], (0.5, 0.1, 0.2), UP),
    "faces below the horizon": ([LOW, FLAT], (-1.4, -0.2, 0.1), (0.6, 0.0, 0.8)),
}
ŠIDÁK = 1.0 - (1.0 - 0.01) ** (1.0 / len(CASES))
SEEN = "const BoxView at = view_boxes(boxes, count_, x, n);"


def table(boxes: list[Corners], scale: float = 1.0) -> NDArray[np.float32]:
    """(2 N, 4): corners as `object_bounds` gives them."""
    rows = np.zeros((2 * len(boxes), 4), np.float32)
    rows[:, :3] = scale * np.reshape(boxes, (-1, 3))
    return rows


def run(
    device: ComputeDevice,
    body: str,
    boxes: list[Corners],
    inputs: dict[str, NDArray[np.float32]],
    outputs: dict[str, str],
    scale: float = 1.0,
) -> dict[str, NDArray[Any]]:
    statements = (SEEN + body).replace("count_", str(len(boxes)))
    return evaluate(
        device, ["world/boxes.h"], statements, inputs, outputs, {"boxes": table(boxes, scale)}
    )


def repeated(x: Place, n: Place, count: int) -> dict[str, NDArray[np.float32]]:
    return {
        "x": np.tile(np.asarray(x, np.float32), (count, 1)),
        "n": np.tile(np.asarray(n, np.float32), (count, 1)),
    }


def drawn(
    device: ComputeDevice, boxes: list[Corners], x: Place, n: Place, count: int, seed: int = 0
) -> NDArray[np.float32]:
    inputs = {**repeated(x, n, count), "u": numbers(seed, count, 3)}
    body = "d = sample_boxes(boxes, count_, at, u.xy, u.z);"
    return run(device, body, boxes, inputs, {"d": "float3"})["d"]


def stated(
    device: ComputeDevice, boxes: list[Corners], x: Place, n: Place, d: NDArray[np.float32]
) -> NDArray[np.float32]:
    inputs = {**repeated(x, n, len(d)), "d": d}
    body = "density = box_density(boxes, count_, at, d);"
    return run(device, body, boxes, inputs, {"density": "float"})["density"]


def enters(boxes: list[Corners], x: Float, d: Float) -> NDArray[np.bool_]:
    """(N, boxes): rays from outside a box that meet it."""
    hits = []
    for low, high in np.asarray(boxes):
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - x) / d, (high - x) / d
        near, far = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        hits.append((near > 0.0) & (near < far))
    return np.stack(hits, -1)


@pytest.mark.parametrize("name", CASES)
def test_directions_have_the_stated_density(device: ComputeDevice, name: str) -> None:
    """And it integrates to 1, for all drawn directions count."""
    boxes, x, n = CASES[name]
    d = drawn(device, boxes, x, n, 1 << 16)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, atol=1e-5)
    density = partial(stated, device, boxes, x, n)
    assert agreement(d, len(d), density, points=8192) > ŠIDÁK
    integral, variance = Bins(d, 10).integrals(density, 8192)
    assert integral.sum() == pytest.approx(1.0, abs=0.03 + 3.0 * np.sqrt(variance.sum()))


@pytest.mark.parametrize("name", CASES)
def test_there_is_no_density_beside_the_boxes(device: ComputeDevice, name: str) -> None:
    boxes, x, n = CASES[name]
    d = even_directions(1 << 14)
    density = stated(device, boxes, x, n, d)
    met = enters(boxes, np.array(x), d.astype(np.float64))
    assert (density[~met.any(-1)] == 0.0).mean() > 0.9999  # rounded over an edge
    # What is met above the horizon has a density, so that nothing is missed.
    above = d.astype(np.float64) @ np.array(n) > 1e-3
    assert (density[met.any(-1) & above] > 0.0).mean() > 0.9999
    # Other rays from within a box meet it too.
    from_within = (np.array(x) > np.array(boxes)[:, 0]) & (np.array(x) < np.array(boxes)[:, 1])
    body = f"met = meets_boxes(boxes, {len(boxes)}, x, d);"
    told = run(device, body, boxes, {**repeated(x, n, len(d)), "d": d}, {"met": "int"})["met"]
    assert ((told > 0) == (met | from_within.all(-1)).any(-1)).mean() > 0.9999
    axes = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
    assert np.isfinite(stated(device, boxes, x, n, axes)).all()


def test_where_boxes_are_is_what_plain_code_says(device: ComputeDevice) -> None:
    """Above the surface, around the point, with a face to aim at."""
    rng = np.random.default_rng(5)
    count = 4096
    x = rng.uniform(-1.2, 1.2, (count, 3)).astype(np.float32)
    n = rng.normal(size=(count, 3))
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    boxes = [NEAR, AROUND]
    found = run(
        device, "above = at.above; inside = at.inside; total = at.total;"
        "matter = boxes_matter(at, 0.5f); some = boxes_matter(at, 0.0f);", boxes, {"x": x, "n": n},
        {"above": "int", "inside": "int", "total": "float", "matter": "int",
         "some": "int"},
    )  # fmt: skip
    above, inside, aimed = (np.zeros(count, bool) for _ in range(3))
    for box in np.asarray(boxes):
        corners = np.stack(np.meshgrid(*box.T, indexing="ij"), -1).reshape(8, 3)
        heights = (corners[:, None] - x) @ np.eye(3)
        heights = (heights * n).sum(-1)
        above |= (heights > 0.0).any(0)
        inside |= ((x >= box[0]) & (x <= box[1])).all(-1)
        for axis in range(3):
            for side in range(2):
                on_face = corners[:, axis] == box[side, axis]
                beyond = x[:, axis] < box[0, axis] if side == 0 else x[:, axis] > box[1, axis]
                aimed |= beyond & (heights[on_face] > 0.0).any(0)
    np.testing.assert_array_equal(found["above"] > 0, above)
    np.testing.assert_array_equal(found["inside"] > 0, inside)
    np.testing.assert_array_equal(found["total"] > 0.0, aimed)
    assert 0.05 < inside.mean() < 0.95
    assert 0.05 < above.mean() < 0.999
    np.testing.assert_array_equal(found["some"] > 0, above)
    np.testing.assert_array_equal(
        found["matter"] > 0, above & (inside | (found["total"] >= np.float32(0.5)))
    )


def test_the_weight_is_about_the_solid_angle(device: ComputeDevice) -> None:
    """The weight that leaves out small boxes is within a fifth, except very near."""
    boxes, x, n = [FAR], (0.0, 0.0, 0.0), UP
    body = "total = at.total;"
    total = run(device, body, boxes, repeated(x, n, 1), {"total": "float"})["total"][0]
    axis = np.mean(FAR, 0) / np.linalg.norm(np.mean(FAR, 0))
    d = even_directions(1 << 20).astype(np.float64)
    d = d[d @ axis > 0.97]
    seen = enters(boxes, np.zeros(3), d).mean() * 2.0 * np.pi * 0.03
    assert total == pytest.approx(seen, rel=0.2)


def test_scenes_without_boxes_and_boxes_without_faces(device: ComputeDevice) -> None:
    """From the middle of the only box there is no face to aim at: no density anywhere."""
    d = even_directions(256)
    assert stated(device, [AROUND], (0.1, 0.2, 0.3), UP, d).max() == 0.0
    below = [((-1.0, -2.0, -1.0), (1.0, -0.5, 1.0))]
    assert stated(device, below, (0.0, 0.0, 0.0), UP, d).max() == 0.0
