"""Reflection towards the capture centre by a hypothetical dielectric coat on surfaces.

Computed on the host for cells, to detect glossy planes (`evidence`): a few thousand points, for
several roughnesses. Rendering uses `cl/world/real/highlight.cl` instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cell_planes import CellPlane
from iprt.footage.cells import Cells, Float, Geometry, cell_means
from iprt.footage.frame import Frame
from iprt.footage.ray_arcs import RayArcs
from iprt.footage.sky import OUTSIDE_ROWS
from iprt.footage.window_environment import outside_radiance
from iprt.geometry.coat import fresnel_dielectric, visible_normals
from iprt.geometry.equirect import cell_towards

IOR = 1.5
"""Assumed index of refraction of the coat, typical of varnishes, plastics and glazes."""
RAYS = 12
"""Rays per cell and roughness; results are averaged over neighbours within the lobe's width."""
STEPS, HALVINGS = 32, 4
"""Number of march steps per ray, uniform in angle about the capture centre, and of bisections."""
CLEARANCE, THICKNESS = 0.005, 0.3
"""Distances behind a surface, relative to its depth, between which a ray hits it. Beyond the second
one, the ray passes behind it."""
LIFT = 0.01
"""Offset of ray origins from their surface, relative to depth."""
LOWEST = 0.01
"""Least cosine between a ray that leaves a surface and its normal."""
AT_ONCE = 1 << 11
"""Number of rays whose points fit into a processor's cache."""
KINDS, RECOVERED = 2, 1
"""Number of kinds of reflected light, and index of the second one. The first kind is light that the
picture does not clip. The second one is recovered from clipped texels."""

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class RoomCells:
    """The surroundings of reflecting planes in cells, as rays see them.

    Attributes
    ----------
    cells : Cells
        N cells.
    shown : Geometry
        Geometry from which coarser cells can be made.
    color : (N, 3) float64
        Mean radiance.
    kinds : (KINDS, N, 3) float64
        Mean radiance by kind of light: unclipped, and recovered from clipped texels.
    depth : (N,) float32
        Metres.
    open : (N,) bool
        Windows.
    outside : (KINDS, 2 OUTSIDE_ROWS², 3) float64 or None
        `outside_radiance` by kind of light, where there are windows.
    """

    cells: Cells
    shown: Geometry
    color: Float
    kinds: Float
    depth: Floats
    open: NDArray[np.bool_]
    outside: Float | None

    @classmethod
    def of(cls, frame: Frame, shown: Geometry, rows: int) -> RoomCells:
        """Build cells of a frame and its geometry, with `rows` rows; at most the geometry's."""
        cells = Cells.of(shown, rows)
        color = cell_means(frame.radiance, rows).reshape(-1, 3)
        clipped = np.zeros_like(frame.radiance)
        if frame.clipped is not None:
            texel = frame.clipped.texel
            clipped.reshape(-1, 3)[texel] = frame.radiance.reshape(-1, 3)[texel]
        recovered = cell_means(clipped, rows).reshape(-1, 3)
        outside = None
        if frame.opening.any():
            every, there = (
                outside_radiance(light[frame.opening], frame.opening).reshape(-1, 3)
                for light in (frame.radiance, clipped)
            )
            outside = np.stack([every - there, there]).astype(np.float64)
        return cls(
            cells=cells,
            shown=shown,
            color=color,
            kinds=np.stack([color - recovered, recovered]),
            depth=cells.depth.astype(np.float32),
            open=cells.opening > 0.5,
            outside=outside,
        )


@dataclass(frozen=True)
class Patch:
    """Cells of a plane, in the axes of a frame's capture centre.

    Attributes
    ----------
    start : (n, 3) float64
        Origins of reflected rays in metres, slightly off the cells.
    direction : (n, 3) float64
        Unit vectors from the capture centre to the cells.
    normal : (3,) float64
        Normal of the plane, towards the capture centre.
    """

    start: Float
    direction: Float
    normal: Float

    @classmethod
    def of(cls, cells: Cells, plane: CellPlane) -> Patch:
        """Build the patch of a plane, in the frame where the plane was found."""
        on = plane.cells
        start = cells.point[on] + LIFT * cells.depth[on, None] * plane.normal
        return cls(start, cells.direction[on], plane.normal)


def reflected(around: RoomCells, patch: Patch, alpha: float, seed: int, rays: int = RAYS) -> Float:
    """Estimate the radiance (KINDS, n, 3) that a coat on a plane reflects to the capture centre.

    This is the Monte Carlo integral of f_s L cos over the GGX lobe. Visible normals are sampled
    after Dupuy and Benyoub (HPG 2023), with Smith's masking as in `cl/lib/world/brdf.h`.
    """
    across, along = _tangents(patch.normal)
    local = np.stack([across, along, patch.normal])
    out = -patch.direction @ local.T
    masked = _masking(out[:, 2], alpha)
    rng = np.random.default_rng(seed)
    total = np.zeros((KINDS, len(out), 3))
    for ray in range(rays):
        u, v = rng.random((2, len(out)))
        facet = visible_normals(out, alpha, u, (ray + v) / rays)
        cosine = np.einsum("ij,ij->i", out, facet)
        into = 2.0 * cosine[:, None] * facet - out
        leaves = into[:, 2] > LOWEST
        weight = fresnel_dielectric(np.clip(cosine, 0.0, 1.0), IOR) * (1.0 + masked)
        weight /= 1.0 + masked + _masking(into[:, 2], alpha)
        found = radiance_along(around, patch.start[leaves], into[leaves] @ local)
        total[:, leaves] += weight[leaves, None] * found
    return total / rays


def radiance_along(around: RoomCells, start: Float, direction: Float) -> Float:
    """Return radiance (KINDS, n, 3) along rays from points (n, 3), in metres; unit directions."""
    found = [
        _found(around, start[at : at + AT_ONCE], direction[at : at + AT_ONCE])
        for at in range(0, len(start), AT_ONCE)
    ]
    return np.concatenate(found, axis=1) if found else np.zeros((KINDS, 0, 3))


def _found(around: RoomCells, start: Float, direction: Float) -> Float:
    """Return radiance (KINDS, n, 3) along one batch of rays."""
    arcs = RayArcs(start, direction)

    def behind(angle: Floats) -> tuple[Floats, NDArray[np.intp]]:
        return arcs.behind(angle, around.depth, around.cells.rows)

    whole = arcs.whole
    step = whole / np.float32(STEPS + 1)
    deep, _ = behind(np.arange(1, STEPS + 1, dtype=np.float32)[:, None] * step)
    before = np.concatenate([np.full((1, len(start)), -1.0, np.float32), deep[:-1]])
    enters = (deep > CLEARANCE) & (deep < THICKNESS) & (before <= CLEARANCE)
    hits = enters.any(axis=0)
    far = np.where(hits, (enters.argmax(axis=0) + 1) * step, whole)
    near = np.where(hits, far - step, far)
    for _ in range(HALVINGS):
        middle = np.float32(0.5) * (near + far)
        inside = behind(middle[None])[0][0] > 0.0
        near, far = np.where(inside, near, middle), np.where(inside, middle, far)
    cell = behind(far[None])[1][0]
    radiance = around.kinds[:, cell]
    if around.outside is not None:
        open_ = around.open[cell]
        way = direction[open_].astype(np.float32)
        sky = cell_towards(way, np.ones(len(way), np.float32), OUTSIDE_ROWS)
        radiance[:, open_] = around.outside[:, sky]
    return np.asarray(radiance)


def _tangents(normal: Float) -> tuple[Float, Float]:
    """Return two unit vectors (3,) that make a right-handed frame with a unit normal (3,)."""
    beside = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = np.cross(beside, normal)
    across /= np.linalg.norm(across)
    return across, np.cross(normal, across)


def _masking(cosine: Float, alpha: float) -> Float:
    """Return Smith's Λ of GGX."""
    tan2 = 1.0 / np.maximum(cosine, 1e-4) ** 2 - 1.0
    return np.asarray(0.5 * (np.sqrt(1.0 + alpha**2 * np.maximum(tan2, 0.0)) - 1.0))
