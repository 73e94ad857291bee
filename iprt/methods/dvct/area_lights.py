"""Area lights from a panorama: a median cut into regions of equal flux, each replaced by a disc."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import LUMINANCE
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_texel, solid_angles

Float = NDArray[np.float64]

SKY = 4.0
"""Distance of open sky as a multiple of the farthest surface's."""
BEFORE = 0.98
"""Factor of the lights' distances: rays that leave them are clear of the surface behind."""
LEAST_COSINE = 0.2
"""Lower bound of the cosine at a disc between its normal and the capture centre: its power is
divided by this cosine."""


@dataclass(frozen=True)
class Region:
    """Rectangle of cells, [top, bottom) x [left, right), of an equirect grid."""

    top: int
    bottom: int
    left: int
    right: int


def median_cut(flux: Float, count: int) -> list[Region]:
    """Divide a panorama into regions of about equal flux.

    P. Debevec, "A Median Cut Algorithm for Light Probe Sampling". The region of largest flux is
    divided next, across its longer side, into halves of equal flux.

    Parameters
    ----------
    flux : (rows, columns) float64
        Flux of the cells of an equirect grid, >= 0.
    count : int
        Number of regions; fewer are returned if fewer cells emit light.
    """
    if not flux.any():
        return []
    # The number makes the order of regions with equal flux deterministic.
    queue = [(-float(flux.sum()), 0, _lit(flux, Region(0, flux.shape[0], 0, flux.shape[1])))]
    done: list[Region] = []
    number = 0
    while queue and len(queue) + len(done) < count:
        _, _, region = heapq.heappop(queue)
        halves = _divided(flux, region)
        if len(halves) == 1:
            done.append(region)
        for half in halves if len(halves) == 2 else ():
            number += 1
            part = flux[half.top : half.bottom, half.left : half.right].sum()
            heapq.heappush(queue, (-float(part), number, _lit(flux, half)))
    return done + [region for _, _, region in sorted(queue)]


def _lit(flux: Float, region: Region) -> Region:
    """Return a region without the dark rows and columns at its edges."""
    part = flux[region.top : region.bottom, region.left : region.right] > 0.0
    rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
    return Region(
        region.top + int(rows[0]),
        region.top + int(rows[-1]) + 1,
        region.left + int(columns[0]),
        region.left + int(columns[-1]) + 1,
    )


def _divided(flux: Float, region: Region) -> list[Region]:
    """Return the two halves of a region, or a single cell itself."""
    top, bottom, left, right = region.top, region.bottom, region.left, region.right
    middle = np.pi * (0.5 * (top + bottom) / flux.shape[0] - 0.5)
    part = flux[top:bottom, left:right]
    wide = (right - left) * np.cos(middle)
    if right - left > 1 and (wide >= bottom - top or bottom - top == 1):
        cut = left + _half(part.sum(axis=0))
        return [Region(top, bottom, left, cut), Region(top, bottom, cut, right)]
    if bottom - top > 1:
        cut = top + _half(part.sum(axis=1))
        return [Region(top, cut, left, right), Region(cut, bottom, left, right)]
    return [region]


def _half(flux: Float) -> int:
    """Return the number of leading entries with about half of the sum: at least one, not all."""
    before = np.cumsum(flux)[:-1]
    return 1 + int(np.argmin(np.abs(before - 0.5 * flux.sum())))


def area_lights(
    radiance: Float, distance: Float, normal: Float, opening: Float, count: int, farthest: float
) -> NDArray[np.float32]:
    """Build a disc for each region of a panorama.

    A disc lies at the cell nearest to its region's centroid of flux. It has the mean normal of the
    region, weighted by flux, and the same flux at the capture centre.

    Parameters
    ----------
    radiance : (rows, columns, 3) float64
        Mean radiance of the cells of an equirect grid.
    distance : (rows, columns) float64
        Metres from the capture centre; 0: open sky.
    normal : (rows, columns, 3) float64
        Unit vectors towards the capture centre.
    opening : (rows, columns) float64
        1 at windows, else 0.
    count : int
        Number of regions.
    farthest : float
        Largest distance, metres.

    Returns
    -------
    (N, 3, 4) float32
        N <= count. Position in the axes of the capture centre and squared radius, in metres;
        normal, and the share of the flux that comes through windows; radiance times area along the
        normal, per color.
    """
    rows, columns = distance.shape
    directions = View(columns, rows, projection="equirect").directions().astype(np.float64)
    solid_angle = solid_angles(columns, rows)[:, None]
    away = np.where(distance > 0.0, distance, SKY * max(farthest, 1.0))
    points = directions * away[..., None]
    flux = radiance * solid_angle[..., None]
    weight = flux @ LUMINANCE
    found = []
    for r in median_cut(weight, count):
        part = (slice(r.top, r.bottom), slice(r.left, r.right))
        share = (weight[part] / weight[part].sum()).ravel()
        towards = directions[part].reshape(-1, 3)
        place = int(np.argmax(towards @ (share @ towards)))
        centre = points[part].reshape(-1, 3)[place]
        spread = share @ np.square(
            points[part].reshape(-1, 3) - share @ points[part].reshape(-1, 3)
        )
        # The mean squared distance of a disc's points from its centre is half its squared radius.
        cell = np.pi / rows * away[part].ravel()[place]
        squared = 2.0 * float(spread.sum()) + cell**2 / np.pi
        facing = share @ normal[part].reshape(-1, 3)
        facing /= max(float(np.linalg.norm(facing)), 1e-9)
        cosine = max(float(-facing @ towards[place]), LEAST_COSINE)
        reach = float(centre @ centre) + squared
        power = flux[part].reshape(-1, 3).sum(axis=0) * reach / cosine
        open_share = float(share @ opening[part].ravel())
        found.append([[*BEFORE * centre, squared], [*facing, open_share], [*power, 0.0]])
    return np.array(found, np.float32).reshape(-1, 3, 4)


def aimed(
    lights: NDArray[np.float32], low: Float, high: Float, outside: Float | None
) -> NDArray[np.float32]:
    """Aim the shadow maps and the windows of lights at a box.

    Parameters
    ----------
    lights : (N, 3, 4) float32
        Discs that `area_lights` returned.
    low, high : (3,) float64
        Corners of the box, metres.
    outside : (rows, columns, 3) float64 or None
        Radiance behind windows, equirect, by which their power is scaled towards the box; None:
        windows emit alike in all directions.

    Returns
    -------
    (N, 4, 4) float32
        Rows of `AreaLight` in `cl/methods/dvct/area_lights.h`.
    """
    position = lights[:, 0, :3].astype(np.float64)
    axis = 0.5 * (low + high) - position
    away = np.linalg.norm(axis, axis=1)
    radius = 0.5 * float(np.linalg.norm(high - low))
    # From inside the box's bounding sphere: a hemisphere.
    angle = np.arcsin(np.minimum(radius / np.maximum(away, 1e-9), 1.0))
    rows = np.zeros((len(lights), 4, 4), np.float32)
    rows[:, :3] = lights
    rows[:, 3, :3] = np.where(
        away[:, None] > 1e-6, axis / np.maximum(away, 1e-9)[:, None], lights[:, 1, :3]
    )
    rows[:, 3, 3] = np.sin(0.5 * angle)
    if outside is not None:
        here, there = (_looked_up(outside, way) for way in (position, -axis))
        share = lights[:, 1, 3:]
        rows[:, 2, :3] *= 1.0 + share * (there / np.maximum(here, 1e-9) - 1.0)
    return rows


def _looked_up(picture: Float, directions: Float) -> Float:
    """Return the texels (N, 3) of an equirect picture in directions (N, 3) of any length."""
    rows, columns, _ = picture.shape
    return np.asarray(picture[equirect_texel(directions, columns, rows)])
