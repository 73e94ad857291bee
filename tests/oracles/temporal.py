"""Slow numpy twin of temporal accumulation and of its variance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.oracles.guide import Array, bordered, shown


@dataclass(frozen=True)
class History:
    """(C, H, W) signal, (H, W) length in samples, (H, W) spread of the shown scalar."""

    signal: Array
    length: Array
    spread: Array


def reproject(
    guide: Array,
    before: Array,
    motion: Array,
    history: History,
    limits: tuple[float, float],
    equirect: bool,
    *,
    spline: bool = True,
) -> History:
    """Look up bilinearly, or by a spline in reflected signals.

    `guide` and `before` are (7, H, W), `limits` plane tolerance and cosine.
    """
    height, width = motion.shape[1:]
    result = History(*(np.zeros(a.shape) for a in vars(history).values()))
    for y, x in np.argwhere(guide[6] > 0.0):
        normal, position = guide[:3, y, x], guide[3:6, y, x]
        mx, my = motion[0, y, x] - 0.5, motion[1, y, x] - 0.5
        if abs(mx) > 1e6 or abs(my) > 1e6:
            continue
        total = 0.0
        sums = [np.zeros(len(history.signal)), 0.0, 0.0]
        for j in (0, 1):
            for i in (0, 1):
                tx, ty = int(np.floor(mx)) + i, int(np.floor(my)) + j
                weight = (1.0 - abs(mx - tx)) * (1.0 - abs(my - ty))
                tx = tx % width if equirect else tx
                if weight <= 0.0 or not (0 <= tx < width and 0 <= ty < height):
                    continue
                tap = before[:, ty, tx]
                off = abs(normal @ (tap[3:6] - position))
                if (
                    tap[6] != guide[6, y, x]
                    or off > limits[0] * np.linalg.norm(position)
                    or tap[:3] @ normal < limits[1]
                    or history.length[ty, tx] <= 0.0
                ):
                    continue
                sums[0] += weight * history.signal[:, ty, tx]
                sums[1] += weight * history.length[ty, tx]
                sums[2] += weight * history.spread[ty, tx]
                total += weight
        if total > 0.01:
            result.signal[:, y, x] = sums[0] / total
            if spline and total > 0.999 and len(history.signal) == 3:
                sharp = _spline(before[6] == guide[6, y, x], history, mx, my, equirect)
                result.signal[:, y, x] = result.signal[:, y, x] if sharp is None else sharp
            result.length[y, x] = sums[1] / total
            result.spread[y, x] = sums[2] / total
    return result


def _spline(same: Array, history: History, mx: float, my: float, equirect: bool) -> Array | None:
    """Cubic with the slopes of central differences at the samples, first along rows."""
    height, width = same.shape
    x, y = int(np.floor(mx)), int(np.floor(my))
    columns, rows = np.arange(x - 1, x + 3), np.arange(y - 1, y + 3)
    columns = columns % width if equirect else columns
    if rows[0] < 0 or rows[3] >= height or columns.min() < 0 or columns.max() >= width:
        return None
    window = np.ix_(rows, columns)
    if not (same & (history.length > 0.0))[window].all():
        return None

    def between(p: Array, t: float) -> Array:
        """Hermite spline between p[..., 1] and p[..., 2]."""
        a, b = p[..., 1], p[..., 2]
        slope_a, slope_b = (b - p[..., 0]) / 2.0, (p[..., 3] - a) / 2.0
        square = 3.0 * (b - a) - 2.0 * slope_a - slope_b
        cube = 2.0 * (a - b) + slope_a + slope_b
        return np.asarray(a + t * (slope_a + t * (square + t * cube)))

    values = history.signal[:, window[0], window[1]]
    nearest = values[:, 1:3, 1:3].reshape(len(values), -1)
    found = between(between(values, mx - x), my - y)
    return np.clip(found, nearest.min(axis=1), nearest.max(axis=1))


def worth(length: Array, spread: Array, bias: Array) -> Array:
    """Unbiased samples with the mean squared error of a history that is off by `bias`."""
    error = spread / np.maximum(length, 1e-30) + bias**2
    return np.where(bias > 0.0, spread / np.maximum(error, 1e-30), length)


def sample_worth(past: History, level: Array) -> Array:
    """Rays: 1 / 4**level; of a pixel that waits (3), 1 / 4 if it knows nothing, else 0."""
    return np.where(level == 3, np.where(past.length > 0.0, 0.0, 0.25), 0.25**level)


def follow(past: History, signal: Array, ids: Array, level: Array, limit: float) -> History:
    """Add samples of `sample_worth` to a mean that is worth `limit` at most."""
    weight = sample_worth(past, level)
    total = np.minimum(past.length + weight, limit)
    share = np.where(past.length > 0.0, np.minimum(weight / total, 1.0), 1.0)
    here = ids > 0.0
    mean = past.signal + share * (signal - past.signal)
    return History(
        np.where(here, mean, past.signal), np.where(here, total, past.length), past.spread
    )


def neighbours(image: Array, y: int, x: int, same: Array, step: int = 2) -> Array:
    """(..., n) of the nine pixels around one, `step` apart, that are `same`."""
    size = 2 * step + 1
    return image[..., y : y + size : step, x : x + size : step][..., same]


def limited(signal: Array, ids: Array, most: float, equirect: bool) -> Array:
    """Reduce samples to `most` times the brightest of at least three pixels around them."""
    wide, wide_ids = bordered(shown(signal), 1, equirect), bordered(ids, 1, equirect, fill=-1.0)
    result = signal.copy()
    for y, x in np.argwhere(ids > 0.0):
        around = wide_ids[y : y + 3, x : x + 3] == ids[y, x]
        around[1, 1] = False
        brightest = most * wide[y : y + 3, x : x + 3][around].max(initial=0.0)
        own = shown(signal)[y, x]
        if around.sum() >= 3 and own > brightest:
            result[:, y, x] *= brightest / own
    return result


def correct(slow: History, fast: History, ids: Array, sigma: float, equirect: bool) -> History:
    """Mix in the fast history as far as the slow one's bias makes it the worse estimate."""
    wide = bordered(shown(fast.signal) - shown(slow.signal), 2, equirect)
    wide_ids = bordered(ids, 2, equirect, fill=-1.0)
    result = History(*(a.copy() for a in vars(slow).values()))
    for y, x in np.argwhere((ids > 0.0) & (slow.length > 0.0) & (fast.length > 0.0)):
        same = wide_ids[y : y + 5 : 2, x : x + 5 : 2] == ids[y, x]
        steps = neighbours(wide, y, x, same)
        noise = sigma**2 * steps.var() / max(len(steps) - 1, 1)
        bias = np.sqrt(max(steps.mean() ** 2 - noise, 0.0))
        length = slow.length[y, x]
        share = 1.0 - worth(length, slow.spread[y, x], bias) / length
        past = slow.signal[:, y, x]
        result.signal[:, y, x] = past + share * (fast.signal[:, y, x] - past)
        result.length[y, x] = length + share * (min(fast.length[y, x], length) - length)
    return result


def clamp(
    slow: History, nearby: Array, ids: Array, sigma: float, equirect: bool, *, common: bool
) -> History:
    """Clamp to mean ± sigma deviations of nine neighbours; `common`: E_RV by E_RV - E_R."""

    def split(s: Array) -> Array:
        return np.concatenate([s[:3], s[3:] - s[:3]]) if common else s

    result = History(*(a.copy() for a in vars(slow).values()))
    wide = bordered(split(nearby), 2, equirect)
    wide_ids = bordered(ids, 2, equirect, fill=-1.0)
    for y, x in np.argwhere(ids > 0.0):
        same = wide_ids[y : y + 5 : 2, x : x + 5 : 2] == ids[y, x]
        values = neighbours(wide, y, x, same)
        centre = split(nearby)[:, y, x]
        low = np.minimum(values.mean(1) - sigma * values.std(1), centre)
        high = np.maximum(values.mean(1) + sigma * values.std(1), centre)
        value = split(slow.signal[:, y, x])
        clamped = np.clip(value, low, high)
        if np.any(clamped != value):
            if common:
                clamped[3:] += clamped[:3]
            bias = abs(shown(clamped) - shown(slow.signal[:, y, x]))
            result.signal[:, y, x] = clamped
            result.length[y, x] = worth(slow.length[y, x], slow.spread[y, x], bias)
    return result


def accumulate(past: History, signal: Array, ids: Array, level: Array, fading: float) -> History:
    """Add samples of `sample_worth` w, with the larger of w / (length + w) and w fading."""
    worth = sample_worth(past, level)
    share = np.maximum(worth / (past.length + worth), fading * worth)
    step = shown(signal) - shown(past.signal)
    first = past.length <= 0.0
    mean = np.where(first, signal, past.signal + share * (signal - past.signal))
    spread = np.where(first, 0.0, (1.0 - share) * (past.spread + share * step**2))
    limit = 2.0 / fading - 1.0 if fading > 0.0 else 1e6
    length = np.minimum(past.length + worth, limit)
    here = ids > 0.0
    kept = here & (worth == 0.0)
    return History(
        np.where(kept, past.signal, np.where(here, mean, 0.0)),
        np.where(kept, past.length, np.where(here, length, 0.0)),
        np.where(kept, past.spread, here * spread),
    )


def variance(now: History, ids: Array, equirect: bool) -> Array:
    """Variance of the mean: of the samples; while they are few, of the pixel and every other one of
    its 7x7 neighbourhood.
    """
    unsure = 1.0 + 8.0 / np.maximum(now.length, 1.0)
    result = unsure * now.spread / np.maximum(now.length - 1.0, 1.0)
    scalars = bordered(shown(now.signal), 3, equirect)
    wide_ids = bordered(ids, 3, equirect, fill=-1.0)
    for y, x in np.argwhere(now.length < 3.5):
        same = wide_ids[y : y + 7 : 2, x : x + 7 : 2] == ids[y, x]
        near = scalars[y : y + 7 : 2, x : x + 7 : 2][same]
        spatial = np.append(near, scalars[y + 3, x + 3]).var()
        result[y, x] = 12.0 / max(now.length[y, x], 1.0) * spatial if ids[y, x] > 0.0 else 0.0
    return result
