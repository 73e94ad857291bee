"""Splatting and filling: the sphere around a point, the nearest in front, gaps and what is not."""

from __future__ import annotations

import numpy as np

from iprt.capture.cloud import Samples
from iprt.capture.gaps import gaps
from iprt.capture.splat import splat
from iprt.geometry.camera import View


def on_sphere(count: int, radius: float, color: float = 0.5) -> Samples:
    """Evenly, by Fibonacci's spiral."""
    k = np.arange(count) + 0.5
    z, phi = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    d = np.stack([r * np.cos(phi), z, r * np.sin(phi)], axis=1).astype(np.float32)
    size = np.full(count, radius * 2.0 / count**0.5, np.float32)
    colors = np.repeat(0.4 + 0.1 * d[:, :1], 3, axis=1) * (color / 0.4)
    return Samples(d * np.float32(radius), colors, -d, size, np.zeros(count, bool))


def joined(a: Samples, b: Samples) -> Samples:
    return Samples(
        *(np.concatenate(pair) for pair in zip(vars(a).values(), vars(b).values(), strict=True))
    )


def test_a_sphere_is_seen_whole() -> None:
    color, depth = splat(on_sphere(20000, 2.0), 128)
    d = View(128, 64, projection="equirect").directions()
    assert (depth > 0.0).all()
    assert np.abs(depth - 2.0).max() < 0.01
    assert np.abs(color[..., 0] - (0.5 + 0.125 * d[..., 0])).max() < 0.01


def test_the_nearer_hides_the_farther() -> None:
    near, far = on_sphere(20000, 1.0, 0.1), on_sphere(20000, 3.0, 0.8)
    right = near.at(np.flatnonzero(near.position[:, 0] > 0.3))
    _, depth = splat(joined(far, right), 128)
    d = View(128, 64, projection="equirect").directions()
    assert np.abs(depth[d[..., 0] > 0.35] - 1.0).max() < 0.01
    assert np.abs(depth[d[..., 0] < 0.2] - 3.0).max() < 0.03


def test_clipped_colors_yield_to_others() -> None:
    clipped, seen = on_sphere(20000, 2.0, 0.9), on_sphere(20000, 2.0, 0.3)
    clipped.clipped[:] = True
    (both, _), (alone, _) = splat(joined(clipped, seen), 64), splat(seen, 64)
    assert np.abs(both - alone).max() < 0.005
    assert splat(clipped, 64)[0].mean() > 2.5 * alone.mean()


def test_gaps_are_told_from_what_was_never_seen() -> None:
    seen = np.ones((64, 128), bool)
    seen[10:13, 126:] = seen[10:13, :3] = False  # over the seam
    seen[30:60, 40:80] = False
    found = gaps(seen)
    assert found[10:13, 126:].all()
    assert found[10:13, :3].all()
    assert not found[36:54, 46:74].any()
    assert not (found & seen).any()
