"""An environment with a window, and a diffuse ball's light in it by quadrature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.oracles.worlds import Sphere
from tests.worlds import Float, panorama_at, sphere_frame

CLAY = Material(albedo=(0.8, 0.5, 0.2))
UP = np.array([0.0, 1.0, 0.0])


def windowed(width: int = 128, height: int = 64) -> Frame:
    """The inside of a sphere, dim, with a bright, soft-edged window to the upper right."""
    d = View(width, height, projection="equirect").directions()
    towards = np.array([0.6, 0.64, -0.48])
    window = 5.0 * np.exp(10.0 * (d @ towards - 1.0))
    light = 0.2 + window[..., None] * [1.0, 0.7, 0.4]
    return replace(sphere_frame(2.0, width, height, 1.0), color=light.astype(np.float32))


def sphere_directions(count: int) -> Float:
    """(count, 3) directions evenly over the sphere, each for as large a solid angle."""
    i = np.arange(count) + 0.5
    y, turn = 1.0 - 2.0 * i / count, np.pi * (1.0 + 5.0**0.5) * i
    s = np.sqrt(1.0 - y * y)
    return np.stack([s * np.cos(turn), y, s * np.sin(turn)], -1)


def environment_irradiance(frame: Frame, normals: Float) -> Float:
    """(N, 3) irradiance / π from the whole environment, by quadrature."""
    d = sphere_directions(20_000)
    light = panorama_at(frame.color.astype(np.float64), d)
    cosine = np.maximum(normals @ d.T, 0.0)
    return np.asarray(cosine @ light * (4.0 / len(d)))


def hidden_and_bounced(
    frame: Frame, points: Float, normals: Float, ball: Sphere, albedo: Float
) -> tuple[Float, Float]:
    """(N, 3) irradiance / π at points that a diffuse ball hides, and that it sends instead.

    By quadrature over the cone in which the ball is seen: what is behind it by direction alone,
    and on it the irradiance of its own normals.
    """
    fine = sphere_directions(60_000)
    hidden, bounced = np.zeros((2, len(points), 3))
    for i, (point, up) in enumerate(zip(points, normals, strict=True)):
        enter, _, normal, _ = ball.interval(np.broadcast_to(point, fine.shape), fine)
        met = np.isfinite(enter) & (enter > 0.0)
        weight = (fine[met] @ up * (4.0 / len(fine)))[:, None]
        hidden[i] = (weight * panorama_at(frame.color.astype(np.float64), fine[met])).sum(0)
        sent = environment_irradiance(frame, normal[met][::8])
        bounced[i] = albedo * (weight[::8] * sent).sum(0) * (weight.sum() / weight[::8].sum())
    return hidden, bounced
