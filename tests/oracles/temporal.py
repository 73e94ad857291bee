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
) -> History:
    """Bilinear lookup; `guide` and `before` are (7, H, W), `limits` plane tolerance and cosine."""
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
            result.length[y, x] = sums[1] / total
            result.spread[y, x] = sums[2] / total
    return result


def clamp(
    past: History,
    signal: Array,
    ids: Array,
    step: int,
    sigma: float,
    length: float,
    equirect: bool,
) -> History:
    """Clamp E_R (or the signal) and E_RV - E_R to mean ± sigma deviations of nine neighbours."""

    def split(s: Array) -> Array:
        return np.concatenate([s[:3], s[3:] - s[:3]]) if len(s) == 6 else s

    result = History(*(a.copy() for a in vars(past).values()))
    wide = bordered(split(signal), step, equirect)
    wide_ids = bordered(ids, step, equirect, fill=-1.0)
    size = 2 * step + 1
    for y, x in np.argwhere((ids > 0.0) & (past.length > 0.0)):
        same = wide_ids[y : y + size : step, x : x + size : step] == ids[y, x]
        values = wide[:, y : y + size : step, x : x + size : step][:, same]
        centre = split(signal)[:, y, x]
        low = np.minimum(values.mean(1) - sigma * values.std(1), centre)
        high = np.maximum(values.mean(1) + sigma * values.std(1), centre)
        value = split(past.signal[:, y, x])
        clamped = np.clip(value, low, high)
        if np.any(clamped != value):
            clamped[3:] += clamped[: len(clamped) - 3]
            result.signal[:, y, x] = clamped
            result.length[y, x] = min(past.length[y, x], length)
    return result


def accumulate(past: History, signal: Array, ids: Array, level: Array, fading: float) -> History:
    """Add samples worth w = 1 / 4**level, with the larger of w / (length + w) and w fading."""
    worth = 0.25**level
    share = np.maximum(worth / (past.length + worth), fading * worth)
    step = shown(signal) - shown(past.signal)
    first = past.length <= 0.0
    mean = np.where(first, signal, past.signal + share * (signal - past.signal))
    spread = np.where(first, 0.0, (1.0 - share) * (past.spread + share * step**2))
    limit = 2.0 / fading - 1.0 if fading > 0.0 else 1e6
    length = np.minimum(past.length + worth, limit)
    here = ids > 0.0
    return History(np.where(here, mean, 0.0), np.where(here, length, 0.0), here * spread)


def variance(now: History, ids: Array, equirect: bool) -> Array:
    """Variance of the mean: of the samples, or of a 7x7 neighbourhood while they are few."""
    result = now.spread / np.maximum(now.length - 1.0, 1.0)
    scalars = bordered(shown(now.signal), 3, equirect)
    wide_ids = bordered(ids, 3, equirect, fill=-1.0)
    for y, x in np.argwhere(now.length < 3.5):
        same = wide_ids[y : y + 7, x : x + 7] == ids[y, x]
        spatial = scalars[y : y + 7, x : x + 7][same].var()
        result[y, x] = 4.0 / max(now.length[y, x], 1.0) * spatial if ids[y, x] > 0.0 else 0.0
    return result
