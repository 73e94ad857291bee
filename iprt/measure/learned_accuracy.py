"""Accuracy, time and memory of `oil`'s learned surface radiance of a panorama."""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.output.display import display
from iprt.settings.trace import LearningSettings
from iprt.world.real.panorama import Panorama
from iprt.world.real.radiance_models import Learner, Learning

Float = NDArray[np.float32]

VOXEL_BYTES = 16
"""Bytes of a voxel: sums of three channels and a count, 4 bytes each."""
TABLE_BYTES = 12
"""Least bytes of a hash table per voxel: the key or position, and the link to the next entry."""


@dataclass(frozen=True)
class LearnedAccuracy:
    """Accuracy and cost of learning from a panorama.

    Attributes
    ----------
    error, dense_error, sparse_error : float
        RMSE of displayed values (white is 1) on held-out samples: of the models, of the means of a
        dense voxel grid of at least equal memory, as in the paper's Figure 10, and of a sparse
        grid, which stores only voxels that contain samples.
    megabytes : tuple of float
        Memory of the models and their grid after each frame.
    ms : float
        Median learning time of a frame.
    known : float
        Share of the held-out samples for which the models give a value.
    """

    error: float
    dense_error: float
    sparse_error: float
    megabytes: tuple[float, ...]
    ms: float
    known: float


def learn_frame(
    device: ComputeDevice, frame: Frame, own: LearningSettings, frames: int, exposure: float
) -> LearnedAccuracy:
    """Learn from `frames` copies of a frame and evaluate at held-out texels."""
    panorama = Panorama(device, frame.width, frame.height)
    panorama.load(frame)
    learner = Learner(device, own.samples, own.models)
    metre, unit = panorama.scale, panorama.mean_radiance
    how = Learning(own.search_radius * metre, metre, unit, own.forgetting)
    held_out = _surfaces(learner.draw(panorama.surfaces, panorama.radiated)()[0])
    held = np.unique(_keys(held_out))
    megabytes, times, seen = [], [], []
    for _ in range(frames):
        start = time.perf_counter()
        drawn, covered = learner.draw(panorama.surfaces, panorama.radiated)()
        taken = time.perf_counter() - start
        kept = (drawn[:, 1, 3] > 0.0) & ~np.isin(_keys(drawn), held)
        drawn, covered = drawn[kept], covered[kept]
        start = time.perf_counter()
        learner.learn(drawn, how, covered)
        device.wait()
        times.append(1e3 * (taken + time.perf_counter() - start))
        megabytes.append(learner.nbytes / 1e6)
        seen.append(drawn)
    predicted, known = learner.ask(held_out)
    dense, sparse = (
        voxel_means(np.concatenate(seen), held_out, learner.nbytes, dense=dense)
        for dense in (True, False)
    )
    truth = held_out[known, 2, :3]
    error, dense_error, sparse_error = (
        _rmse(values[known], truth, exposure) for values in (predicted, dense, sparse)
    )
    return LearnedAccuracy(
        error, dense_error, sparse_error, tuple(megabytes), median(times), float(known.mean())
    )


def voxel_means(samples: Float, asked: Float, nbytes: int, *, dense: bool) -> Float:
    """Return the mean radiance of `samples` in the voxels of the points `asked`, (N, 3).

    The voxels are the largest cubes whose grid takes at least `nbytes`. Empty voxels are 0.

    Parameters
    ----------
    samples, asked : (N, SAMPLE_PARTS, 4) float32
    dense : bool
        Store all voxels of the bounding box, else only the ones that contain samples.
    """
    low, high = samples[:, 0, :3].min(axis=0), samples[:, 0, :3].max(axis=0)
    size = float((high - low).max())
    while True:
        counts = np.maximum(np.ceil((high - low) / size), 1.0).astype(np.int64)
        occupied, voxel = np.unique(_voxels(samples, low, size, counts), return_inverse=True)
        need = VOXEL_BYTES * int(counts.prod())
        if not dense:
            need = (VOXEL_BYTES + TABLE_BYTES) * len(occupied)
        if need >= nbytes or size < 1e-3 * float((high - low).max()):
            break
        size *= 0.97
    means = np.zeros((len(occupied), 3))
    for channel in range(3):
        means[:, channel] = np.bincount(voxel, samples[:, 2, channel]) / np.bincount(voxel)
    there = _voxels(asked, low, size, counts)
    at = np.minimum(np.searchsorted(occupied, there), len(occupied) - 1)
    return np.where((occupied[at] == there)[:, None], means[at], 0.0).astype(np.float32)


def _voxels(
    samples: Float, low: Float, size: float, counts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the indices of the voxels that contain the samples, (N,)."""
    cell = np.clip(np.floor((samples[:, 0, :3] - low) / size).astype(np.int64), 0, counts - 1)
    return np.asarray((cell[:, 2] * counts[1] + cell[:, 1]) * counts[0] + cell[:, 0])


def _surfaces(samples: Float) -> Float:
    return samples[samples[:, 1, 3] > 0.0]


def _keys(samples: Float) -> NDArray[np.void]:
    """Return one hashable value per texel, its position, (N,)."""
    points = np.ascontiguousarray(samples[:, 0, :3])
    return points.view(np.dtype((np.void, points.itemsize * 3))).ravel()


def _rmse(values: Float, truth: Float, exposure: float) -> float:
    shown = [display(image[None], exposure) for image in (values, truth)]
    return float(np.sqrt(np.mean((shown[0].astype(np.float64) - shown[1]) ** 2)))
