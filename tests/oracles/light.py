"""NumPy twins of the device's sums of a panorama's light (`cl/world/real/pictures.cl`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import LUMINANCE, Frame
from iprt.geometry.equirect import solid_angles
from iprt.world.real.cell_light import DARK, TEXELS

Float = NDArray[np.float64]
SAME_DISTANCE, DISTRUST, LEAST_ERROR = 0.02, 0.5, 1e-4


def flux_change(before: NDArray[np.float32], after: NDArray[np.float32]) -> float:
    """Share of the panorama's flux by which two pictures (H, W, 3) differ, in [0, 1]."""
    height = len(after)
    weights = np.sin((np.arange(height) + 0.5) / height * np.pi)
    apart = weights @ np.abs(after - before).mean(axis=(1, 2), dtype=np.float64)
    total = weights @ np.maximum(after, before).mean(axis=(1, 2), dtype=np.float64)
    return float(apart / total) if total > 0.0 else 0.0


def cell_luminance(
    color: NDArray[np.float32],
    rows: int,
    columns: int,
    hidden: NDArray[np.float32] | None = None,
) -> Float:
    """(rows, columns) mean luminance over cells of a picture (H, W, 3); behind it is `hidden`."""
    height, width = color.shape[:2]
    luminance = color.astype(np.float64) @ LUMINANCE
    if hidden is not None:
        luminance = np.maximum(luminance, hidden)
    row, column = np.arange(height) * rows // height, np.arange(width) * columns // width
    cell = (row[:, None] * columns + column).ravel()
    sums = np.bincount(cell, luminance.ravel(), rows * columns)
    return np.asarray(sums / np.bincount(cell, minlength=rows * columns)).reshape(rows, columns)


def light_density(luminance: NDArray[np.floating]) -> Float:
    """(rows, columns) 1/sr of the sampling of lights; all 0 in even light.

    `luminance` (rows, columns) holds means over the cells of an equirect grid.
    """
    rows, columns = luminance.shape
    solid_angle = solid_angles(columns, rows)[:, None]
    mean = float((luminance * solid_angle).sum() / (4.0 * np.pi))
    excess = np.where(luminance > mean * (1.0 + 1e-4), luminance - mean, 0.0)
    total = float((excess * solid_angle).sum())
    return np.asarray(excess / total) if total > 0.0 else np.zeros_like(excess)


def frames_light_change(before: Frame, now: Frame, rows: int) -> tuple[Float, Float]:
    """Factor (cells, 3) of the irradiance between two frames, and its relative error (cells,)."""
    height, width = now.depth.shape
    step = max(1, height // (TEXELS * rows))
    row = np.arange(0, height, step) * rows // height
    column = np.arange(0, width, step) * 2 * rows // width
    cell = (row[:, None] * 2 * rows + column).ravel()
    near, far = (frame.depth[::step, ::step] for frame in (before, now))
    with np.errstate(invalid="ignore"):
        same = np.isfinite(far) & (np.abs(far - near) <= SAME_DISTANCE * far)
    same = same.ravel()

    def light(frame: Frame) -> Float:
        texels = frame.radiance[::step, ::step].reshape(-1, 3)[same]
        sums = [np.bincount(cell[same], texels[:, c], 2 * rows * rows) for c in range(3)]
        return np.stack(sums, -1)

    count = np.bincount(cell[same], minlength=2 * rows * rows).astype(float)
    first, second = (light(one) / np.maximum(count, 1.0)[:, None] for one in (before, now))
    weights = np.sin((np.arange(height) + 0.5) / height * np.pi)
    dark = DARK * np.average(now.radiance.mean(axis=(1, 2)), weights=weights)
    shown = [mean @ LUMINANCE + dark for mean in (first, second)]
    unknown = dark / np.minimum(*shown)
    error = DISTRUST * np.abs(np.log(shown[1] / shown[0])) * (1.0 - unknown)
    error += flux_change(before.radiance, now.radiance) * unknown
    return (second + dark) / (first + dark), np.maximum(error, LEAST_ERROR)


def relit_grid(grid: NDArray[np.float32], factor: Float) -> Float:
    """Irradiance (entries, 4), then as many fluxes, in light changed by (entries, 3) factors."""
    light, flux = np.split(grid.astype(np.float64), 2)
    before = light[:, :3] @ LUMINANCE
    light[:, :3] *= factor
    flux[:, :3] *= (light[:, :3] @ LUMINANCE / before)[:, None]
    return np.concatenate([light, flux])
