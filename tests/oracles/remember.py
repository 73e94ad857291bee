"""NumPy twin of `cl/world/real/remember.cl`: the background of a static camera's video."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import LUMINANCE, Frame

Float = NDArray[np.float64]
FOLLOW, SAME_NORMAL, RIM, LEAST_MARGIN = 1.0 / 64.0, 0.7, 2, 0.02


@dataclass
class Memory:
    """Memory per texel; `around` is the depth that others are compared with."""

    depth: Float
    normal: Float
    color: Float
    opening: NDArray[np.bool_]
    around: Float
    mixed: NDArray[np.bool_]
    hidden: NDArray[np.bool_]
    light: Float


def mixed_rims(depth: Float, thickness: float, ratio: float) -> NDArray[np.bool_]:
    """(H, W): is something nearer by more than the margin within `RIM` texels?"""
    reach = depth + np.maximum(thickness, max(ratio, LEAST_MARGIN) * depth)
    padded = np.pad(reach, ((RIM, RIM), (0, 0)), mode="edge")
    lowest = np.full(depth.shape, np.inf)
    for dy in range(2 * RIM + 1):
        for dx in range(-RIM, RIM + 1):
            lowest = np.minimum(lowest, np.roll(padded[dy : dy + len(depth)], dx, axis=1))
    return np.asarray(lowest < depth)


def remembered(frames: list[Frame], thickness: float, ratio: float) -> Memory:
    """The memory after all frames; `thickness` in metres."""
    shape = frames[0].depth.shape
    memory = Memory(
        np.zeros(shape), np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape, bool),
        np.zeros(shape), np.zeros(shape, bool), np.zeros(shape, bool), np.zeros(shape),
    )  # fmt: skip
    for number, frame in enumerate(frames):
        _follow(memory, frame, thickness, ratio, first=number == 0)
    return memory


def _follow(memory: Memory, frame: Frame, thickness: float, ratio: float, *, first: bool) -> None:
    now = frame.depth.astype(np.float64)
    around = memory.around
    with np.errstate(invalid="ignore"):
        margin = np.maximum(thickness, max(ratio, LEAST_MARGIN) * around)
        uncovered = first | (now > around + margin)
        facing = (frame.normal * memory.normal).sum(-1) > SAME_NORMAL
        alike = np.isfinite(around) & (now >= around - margin) & facing
        moved = around + FOLLOW * (now - around)
    windows = (not first) & frame.opening & memory.opening
    taken = uncovered | (now >= memory.depth) | alike | windows
    mixed = mixed_rims(now, thickness, ratio)
    recolored = taken & (uncovered | ~mixed | memory.mixed)

    memory.around = np.where(taken, np.where(uncovered | ~np.isfinite(moved), now, moved), around)
    memory.depth = np.where(taken, now, memory.depth)
    memory.normal = np.where(taken[..., None], frame.normal, memory.normal)
    memory.color = np.where(recolored[..., None], frame.radiance, memory.color)
    memory.mixed = np.where(recolored, mixed, memory.mixed)
    memory.opening = np.where(taken, frame.opening, memory.opening)
    memory.hidden = ~taken
    behind, before = memory.color @ LUMINANCE, frame.radiance @ LUMINANCE
    memory.light = np.where(memory.hidden & (behind > before), behind, 0.0)
