"""Procedural textures and skies: linear RGB images (H, W, 3) float32, deterministic."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View

Image = NDArray[np.float32]
Color = tuple[float, float, float]


def noise(
    shape: tuple[int, int], cells: tuple[int, int], seed: int, *, octaves: int = 4
) -> NDArray[np.float64]:
    """Return periodic value noise in [0, 1], about 0.5; `cells` are the first octave's."""
    rng = np.random.default_rng(seed)
    total, weight = np.zeros(shape), 0.0
    for octave in range(octaves):
        rows, columns = cells[0] << octave, cells[1] << octave
        lattice = rng.random((rows, columns))
        y = np.linspace(0, rows, shape[0], endpoint=False)
        x = np.linspace(0, columns, shape[1], endpoint=False)
        j, i = y.astype(int), x.astype(int)
        fy, fx = (y - j)[:, None], (x - i)[None]
        fy, fx = fy * fy * (3 - 2 * fy), fx * fx * (3 - 2 * fx)
        j1, i1 = (j + 1) % rows, (i + 1) % columns
        top = lattice[np.ix_(j, i)] * (1 - fx) + lattice[np.ix_(j, i1)] * fx
        bottom = lattice[np.ix_(j1, i)] * (1 - fx) + lattice[np.ix_(j1, i1)] * fx
        total += 0.5**octave * (top * (1 - fy) + bottom * fy)
        weight += 0.5**octave
    return total / weight


def mix(a: Color, b: Color, t: NDArray[np.float64]) -> Image:
    """Return colors between `a` (t = 0) and `b` (t = 1)."""
    return (np.asarray(a) + t[..., None] * (np.asarray(b) - np.asarray(a))).astype(np.float32)


def wood(shape: tuple[int, int], dark: Color, light: Color, seed: int) -> Image:
    """Return wood with grain along the image's rows."""
    rows = shape[0]
    wave = noise(shape, (3, 1), seed, octaves=3)
    fibre = noise(shape, (rows // 4, 3), seed + 1, octaves=2)
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (3 * wave + np.linspace(0, 6, rows)[:, None]))
    return mix(dark, light, np.clip(0.25 + 0.35 * rings + 0.5 * (fibre - 0.3), 0, 1))


def planks(
    shape: tuple[int, int], across: int, lengths: float, dark: Color, light: Color, seed: int
) -> Image:
    """Return floor boards: `across` rows, each cut into about `lengths` boards."""
    rows, columns = shape
    rng = np.random.default_rng(seed)
    image = wood(shape, dark, light, seed)
    board = rows // across
    for k in range(across):
        band = np.roll(image[k * board : (k + 1) * board], rng.integers(columns), axis=1)
        cuts = (rng.random() + np.arange(int(lengths) + 1)) * columns / lengths
        edges = [0, *np.clip(cuts, 0, columns).astype(int), columns]
        for start, stop in pairwise(edges):
            tone = rng.normal(1.0, 0.09) * np.array(
                [1.0, rng.normal(1, 0.015), rng.normal(1, 0.03)]
            )
            band[:, start:stop] *= tone.astype(np.float32)
            band[:, start : start + 2] *= 0.45
        band[:2] *= 0.45
        image[k * board : (k + 1) * board] = band
    return np.clip(image, 0.0, 0.95)


def rug(shape: tuple[int, int], ground: Color, accent: Color, border: Color, seed: int) -> Image:
    """Return a woven rug: rhombs on a ground, two border stripes, and uneven yarn."""
    v, u = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    aspect = shape[1] / shape[0]
    a, b = u * aspect * 3, v * 3
    rhomb = np.abs(np.mod(a + b, 1.0) - 0.5) + np.abs(np.mod(a - b, 1.0) - 0.5)
    lines = ((rhomb > 0.40) & (rhomb < 0.52)) | (rhomb < 0.1)
    image = mix(ground, accent, lines.astype(float))
    edge = np.minimum((1 - np.abs(u)) * aspect, 1 - np.abs(v))
    image[(edge > 0.05) & (edge < 0.10)] = border
    image[(edge > 0.12) & (edge < 0.135)] = accent
    image[edge <= 0.05] = ground
    weave = noise(shape, (shape[0] // 4, shape[1] // 4), seed, octaves=2)
    return (image * (0.7 + 0.6 * weave[..., None])).astype(np.float32)


def fabric(shape: tuple[int, int], color: Color, seed: int) -> Image:
    """Return a plain weave of slightly uneven yarn."""
    yarn = noise(shape, (shape[0] // 4, shape[1] // 16), seed, octaves=2) + noise(
        shape, (shape[0] // 16, shape[1] // 4), seed + 1, octaves=2
    )
    return (np.asarray(color) * (0.55 + 0.45 * yarn[..., None])).astype(np.float32)


def hills(shape: tuple[int, int], palette: list[Color], seed: int) -> Image:
    """Return a picture of a low sun over layers of hills, one color of the palette each."""
    rows, columns = shape
    y, x = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    image = mix(palette[0], palette[1], y)
    image[(x - 0.66) ** 2 * (columns / rows) ** 2 + (y - 0.3) ** 2 < 0.012] = palette[2]
    for k, color in enumerate(palette[3:]):
        ridge = noise((1, columns), (1, 3 + k), seed + k, octaves=3)[0]
        image[y > 0.38 + 0.15 * k + 0.28 * (ridge[None] - 0.5)] = color
    return image


def discs(shape: tuple[int, int], palette: list[Color], seed: int) -> Image:
    """Return a picture of overlapping discs on a plain ground."""
    rows, columns = shape
    rng = np.random.default_rng(seed)
    y, x = np.meshgrid(
        np.linspace(0, rows / columns, rows), np.linspace(0, 1, columns), indexing="ij"
    )
    image = np.broadcast_to(np.float32(palette[0]), (rows, columns, 3)).copy()
    for k in range(7):
        cx, cy = rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.8) * rows / columns
        inside = (x - cx) ** 2 + (y - cy) ** 2 < rng.uniform(0.08, 0.22) ** 2
        image[inside] = 0.35 * image[inside] + 0.65 * np.float32(
            palette[1 + k % (len(palette) - 1)]
        )
    return image


def bands(shape: tuple[int, int], palette: list[Color], seed: int) -> Image:
    """Return a picture of horizontal bands with soft, wavy edges."""
    rows, columns = shape
    bend = noise(shape, (2, 3), seed, octaves=4) - 0.5
    level = np.linspace(0, len(palette) - 1e-6, rows)[:, None] + 1.1 * bend
    index = np.clip(level, 0, len(palette) - 1).astype(int)
    grain = 0.9 + 0.2 * noise(shape, (rows // 4, columns // 4), seed + 1, octaves=1)
    return (np.asarray(palette)[index] * grain[..., None]).astype(np.float32)


def sky(
    width: int,
    *,
    sun: tuple[float, float, float],
    sun_radiance: Color,
    sun_radius_deg: float,
    seed: int,
) -> Image:
    """Return an environment (width / 2, width, 3) in the scene format's equirect convention.

    It shows a clear sky with thin clouds and a sun, over wooded hills in haze.
    """
    direction = View(width, width // 2, projection="equirect").directions()
    height = direction[..., 1]
    up = np.clip(height, 0, 1)[..., None]
    horizon, zenith = np.array([7.5, 8.8, 10.2]), np.array([2.8, 5.2, 10.5])
    image = zenith + (horizon - zenith) * (1 - up) ** 4
    cloud = noise(height.shape, (6, 8), seed, octaves=6)
    cover = np.clip((cloud - 0.52) * 5, 0, 1) * np.clip(4 * height, 0, 1)
    image = image + cover[..., None] * (np.array([12.0, 12.0, 12.2]) - image) * 0.8
    cosine = direction @ (np.asarray(sun) / np.linalg.norm(sun))
    angle = np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))
    image += np.clip(sun_radius_deg + 0.5 - angle, 0, 1)[..., None] * np.asarray(sun_radiance)
    image += 1.2 * np.exp(-((angle / 12) ** 2))[..., None] * np.array([1.0, 0.95, 0.85])
    crest = np.linspace(0.10, -0.10, 4)
    haze = np.array([1.9, 2.2, 2.5])
    leaves = noise(height.shape, (64, 128), seed + 1, octaves=4)[..., None]
    for k, level in enumerate(crest):
        ridge = level + 0.10 * (noise((1, width), (1, 5 + 4 * k), seed + 2 + k, octaves=5)[0] - 0.5)
        color = np.array([0.22, 0.42, 0.11]) * (0.4 + 1.2 * leaves)
        hill = color + (haze - color) * (0.75 - 0.22 * k)
        image = np.where((height < ridge[None])[..., None], hill, image)
    return image.astype(np.float32)
