"""Analytic worlds: what a panorama shows of them, and where a ray truly meets them (float64)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Box:
    """A solid box, turned by `yaw` radians about the vertical through its centre."""

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw: float = 0.0

    def interval(self, o: Float, d: Float) -> tuple[Float, Float, Float, Float]:
        """Entry and exit distance along the line (inf, -inf: missed) and outward normals there."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])  # world from box
        p, v = (o - np.asarray(self.centre)) @ turn, d @ turn
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (-np.asarray(self.half) - p) / v, (np.asarray(self.half) - p) / v
        near, far = np.fmin(a, b), np.fmax(a, b)
        t0, t1 = near.max(-1), far.min(-1)
        hit = t1 > t0
        sign = np.sign(v)
        enter = -sign * (np.arange(3) == near.argmax(-1)[..., None])
        leave = sign * (np.arange(3) == far.argmin(-1)[..., None])
        return (
            np.where(hit, t0, np.inf), np.where(hit, t1, -np.inf), enter @ turn.T, leave @ turn.T
        )  # fmt: skip

    def bounds(self) -> tuple[Float, Float]:
        """Lowest and highest corner of the axis-aligned box around it."""
        c, s = abs(np.cos(self.yaw)), abs(np.sin(self.yaw))
        x, y, z = self.half
        reach = np.array([c * x + s * z, y, s * x + c * z])
        return np.asarray(self.centre) - reach, np.asarray(self.centre) + reach


@dataclass(frozen=True)
class Sphere:
    """A solid ball."""

    centre: tuple[float, float, float]
    radius: float

    def interval(self, o: Float, d: Float) -> tuple[Float, Float, Float, Float]:
        """Entry and exit distance along the line (inf, -inf: missed) and outward normals there."""
        p = o - np.asarray(self.centre)
        along = (p * d).sum(-1)
        miss = p - along[..., None] * d
        chord = self.radius**2 - (miss * miss).sum(-1)
        half = np.sqrt(np.maximum(chord, 0.0))
        t0, t1 = -along - half, -along + half
        enter = (p + t0[..., None] * d) / self.radius
        leave = (p + t1[..., None] * d) / self.radius
        hit = chord > 0.0
        return np.where(hit, t0, np.inf), np.where(hit, t1, -np.inf), enter, leave

    def bounds(self) -> tuple[Float, Float]:
        """Lowest and highest corner of the axis-aligned box around it."""
        return np.asarray(self.centre) - self.radius, np.asarray(self.centre) + self.radius


Solid = Box | Sphere


@dataclass(frozen=True)
class World:
    """A closed room of six walls around the capture centre, with solids in it."""

    low: tuple[float, float, float] = (-2.0, -1.4, -2.5)
    high: tuple[float, float, float] = (2.5, 1.3, 3.0)
    solids: tuple[Solid, ...] = field(default_factory=tuple)

    def first_hit(self, o: Float, d: Float) -> tuple[Float, Float, NDArray[np.int64]]:
        """Distance, normal facing the ray, and which: 0 the room, 1 + index of the solid."""
        o = np.broadcast_to(o, d.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            wall = np.where(d > 0, (self.high - o) / d, (self.low - o) / d)
        wall = np.where(d == 0.0, np.inf, wall)
        t = wall.min(-1)
        normal = -np.sign(d) * (np.arange(3) == wall.argmin(-1)[..., None])
        which = np.zeros(t.shape, np.int64)
        for index, solid in enumerate(self.solids):
            enter, leave, n0, n1 = solid.interval(o, d)
            for reach, n in ((enter, n0), (leave, -n1)):
                nearer = (reach > 1e-9) & (reach < t)
                t = np.where(nearer, reach, t)
                normal = np.where(nearer[..., None], n, normal)
                which = np.where(nearer, index + 1, which)
        return t, normal, which

    def frame(self, width: int, height: int) -> Frame:
        """The panorama of this world, with its exact normals."""
        d = View(width, height, projection="equirect").directions()
        depth, normal, _ = self.first_hit(np.zeros(3), d)
        return frame_of(depth, normal)


def cosine_about(normal: Float, rng: np.random.Generator) -> Float:
    """Random directions (..., 3) about normals, of density cosine / π."""
    d = rng.normal(size=normal.shape)
    d = normal + d / np.linalg.norm(d, axis=-1, keepdims=True)
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))


def frame_of(
    depth: NDArray[np.floating],
    normal: Float | None = None,
    opening: NDArray[np.bool_] | None = None,
) -> Frame:
    """A white frame; normals by central differences of the surface points where not given."""
    height, width = depth.shape
    if normal is None:
        normal = difference_normals(depth)
    return Frame(
        color=np.ones((height, width, 3), np.float32),
        depth=depth.astype(np.float32),
        opening=np.zeros(depth.shape, bool) if opening is None else opening,
        normal=np.where(np.isfinite(depth)[..., None], normal, 0.0).astype(np.float32),
    )


def difference_normals(depth: NDArray[np.floating]) -> Float:
    """(H, W, 3) unit normals facing the centre; towards the centre where nothing else is known."""
    height, width = depth.shape
    v = View(width, height, projection="equirect").directions()
    points = v * np.where(np.isfinite(depth), depth, np.nan)[..., None]
    if height < 3 or width < 3:
        return -v
    across = np.roll(points, -1, 1) - np.roll(points, 1, 1)
    padded = np.concatenate([points[:1], points, points[-1:]])
    n = np.cross(across, padded[2:] - padded[:-2])
    length = np.linalg.norm(n, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        n = n / length
    n = np.where((n * v).sum(-1, keepdims=True) > 0.0, -n, n)
    return np.where(np.isfinite(n).all(-1, keepdims=True), n, -v)
