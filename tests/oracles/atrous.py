"""Slow numpy twin of the à-trous filter."""

from __future__ import annotations

import numpy as np

from tests.oracles.guide import Array, falloff, luminance, shifted, shown

B3 = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
NOISE_FLOOR = 0.002
RELAX = np.array([0.27901, 0.44198, 0.27901])


def widened(roughness: Array, normal: Array, ids: Array, equirect: bool, *, exempt: Array) -> Array:
    """GGX alpha of the lobe of a whole pixel: with the squared steps of normals to neighbours.

    `exempt`: (H, W) pixels whose mirrors stay mirrors.
    """
    turned = np.zeros(ids.shape)
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        step = ((shifted(normal, dx, dy, equirect) - normal) ** 2).sum(0)
        turned += step * (shifted(ids, dx, dy, equirect, fill=-1.0) == ids)
    sharp = exempt & (roughness < 1e-4)
    return np.where(sharp, roughness, np.sqrt(roughness**2 + 0.5 * turned))


def smooth_variance(variance: Array, ids: Array, equirect: bool) -> Array:
    """3x3 binomial mean over pixels of one id."""
    total, weights = np.zeros(ids.shape), np.zeros(ids.shape)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            same = shifted(ids, dx, dy, equirect, fill=-1.0) == ids
            weight = (2 - abs(dx)) * (2 - abs(dy)) * same
            total += weight * shifted(variance, dx, dy, equirect)
            weights += weight
    return total / weights


def least_turn(normal: Array, ids: Array, equirect: bool) -> Array:
    """1 - cosine of the most similar normal of the eight neighbours of one id; 0 from 0.3 on."""
    least = np.full(ids.shape, 0.3)
    for dx, dy in [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]:
        turn = 1.0 - (normal * shifted(normal, dx, dy, equirect)).sum(0)
        same = shifted(ids, dx, dy, equirect, fill=-1.0) == ids
        least = np.where(same, np.minimum(least, turn), least)
    return np.where(least < 0.3, least, 0.0)


def filter_level(
    signal: Array,
    variance: Array,
    normal: Array,
    position: Array,
    ids: Array,
    step: int,
    *,
    sharpness: tuple[float, float] = (24.0, 100.0),
    deviations: float = 6.0,
    roughness: Array | None = None,
    lobe_fraction: float = 0.5,
    delta: bool = False,
    guided: bool = True,
    equirect: bool = False,
) -> tuple[Array, Array]:
    """One level: (C, H, W) signal and (H, W) variance of its shown scalar, with taps at `step`.

    `delta`: the signal is a fraction of all light; `roughness`: widened; without `guided` the
    variance does not count.
    """
    distance = np.maximum(np.linalg.norm(position, axis=0), 1e-15)
    bent = len(signal) == 6 and guided
    turned = least_turn(normal, ids, equirect) if bent else np.zeros(ids.shape)
    normal_sharpness = np.full(ids.shape, sharpness[0])
    lobe = np.zeros(ids.shape)
    usable = ids > 0.0
    if roughness is not None:
        usable = usable & (roughness >= 1e-4)
        lobe = 0.5 / (2.0 * lobe_fraction * np.maximum(roughness, 1e-4)) ** 2
        normal_sharpness = np.maximum(normal_sharpness, 8.0 * lobe)
    floors = NOISE_FLOOR**2 * (1.0 if delta else luminance(signal) ** 2)
    taps = RELAX if len(signal) == 6 and guided else B3
    reach = len(taps) // 2
    total, weights, variances = np.zeros(signal.shape), np.zeros(ids.shape), np.zeros(ids.shape)
    for j in range(-reach, reach + 1):
        for i in range(-reach, reach + 1):
            dx, dy = i * step, j * step
            tap = shifted(signal, dx, dy, equirect)
            v = shifted(variance, dx, dy, equirect)
            away = shifted(position, dx, dy, equirect) - position
            turn = 1.0 - (normal * shifted(normal, dx, dy, equirect)).sum(0)
            turn = np.maximum(turn - turned, 0.0)
            off_plane = np.abs((normal * away).sum(0)) / distance
            noise = deviations**2 * (v + variance) + floors + 1e-30
            x = normal_sharpness * turn + sharpness[1] * off_plane
            x = x + guided * (shown(tap) - shown(signal)) ** 2 / noise
            x = x + lobe * (away**2).sum(0) / distance**2
            same = usable & (shifted(ids, dx, dy, equirect, fill=-1.0) == ids)
            weight = taps[i + reach] * taps[j + reach] * np.where(same, falloff(x), 0.0)
            if i == j == 0:
                weight = np.full(ids.shape, taps[reach] ** 2)
            total += weight * tap
            weights += weight
            variances += weight**2 * v
    return total / weights, variances / weights**2
