"""The mesh of visible surfaces: whole where they are, open where depth jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from iprt.footage.depth_mesh import depth_mesh
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from scenes360.chart.make import box_depth
from tests.truth.conftest import sphere_frame


def box_frame(width: int = 64) -> Frame:
    directions = View(width, width // 2, projection="equirect").directions()
    depth = box_depth(directions)
    points = directions * depth[..., None]
    shift = 1e-4
    beside = box_depth(_unit(directions + shift * _tangent(directions, 0)))
    below = box_depth(_unit(directions + shift * _tangent(directions, 1)))
    a = _unit(directions + shift * _tangent(directions, 0)) * beside[..., None] - points
    b = _unit(directions + shift * _tangent(directions, 1)) * below[..., None] - points
    normal = _unit(np.cross(a, b))
    normal *= -np.sign(np.sum(normal * directions, axis=-1, keepdims=True))
    flags = np.zeros(depth.shape, bool)
    return Frame(
        np.ones((*depth.shape, 3), np.float32),
        depth.astype(np.float32),
        flags,
        normal.astype(np.float32),
    )


def _tangent(directions: np.ndarray, which: int) -> np.ndarray:
    other = _unit(np.cross(directions, [0.3, 1.0, 0.2]))
    return other if which == 0 else np.cross(directions, other)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def enclosed_volume(frame: Frame) -> float:
    mesh = depth_mesh(frame)
    a, b, c = (mesh.positions[mesh.triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_closed_room_encloses_its_volume_facing_inwards() -> None:
    white = np.ones((64, 128, 3), np.float32)
    assert np.isclose(enclosed_volume(sphere_frame(white, 2.0)), -4 / 3 * np.pi * 8, rtol=0.01)
    assert np.isclose(enclosed_volume(box_frame()), -5.5 * 3.3 * 5.5, rtol=0.03)


def test_no_triangle_spans_a_depth_gap_or_a_hole() -> None:
    frame = sphere_frame(np.ones((32, 64, 3), np.float32), 3.0)
    depth = frame.depth.copy()
    depth[10:20, 20:30] = 1.5
    depth[5:8, 50:60] = np.inf
    mesh = depth_mesh(replace(frame, depth=depth))
    radius = np.linalg.norm(mesh.positions, axis=-1)[mesh.triangles]
    assert (radius.max(axis=1) < 1.01 * radius.min(axis=1)).all()
    hole = np.flatnonzero(~np.isfinite(depth.ravel()))
    assert not np.isin(mesh.triangles, hole).any()
    # The near patch is a surface of its own.
    assert np.isclose(radius, 1.5).all(axis=1).sum() == 2 * 9 * 9


def test_the_seam_is_closed_between_the_same_rows() -> None:
    height, width = 8, 16
    frame = sphere_frame(np.ones((height, width, 3), np.float32), 2.0)
    triangles = depth_mesh(frame).triangles
    rows, columns = np.divmod(triangles[(triangles < height * width).all(axis=1)], width)
    assert (np.ptp(rows, axis=1) == 1).all()
    turned = (columns - columns[:, :1] + 1) % width - 1
    assert (np.ptp(turned, axis=1) == 1).all()
    west = (columns[:, 0] + turned.min(axis=1)) % width
    assert (np.bincount(west) == 2 * (height - 1)).all()


def test_grazing_walls_stay_whole() -> None:
    """A long corridor's walls step far in depth from texel to texel, and are no gaps."""
    directions = View(128, 64, projection="equirect").directions()
    depth = 1.0 / np.maximum(np.abs(directions[..., 0]), 0.02)
    normal = np.zeros(directions.shape, np.float32)
    normal[..., 0] = -np.sign(directions[..., 0])
    frame = Frame(
        np.ones(directions.shape, np.float32),
        depth.astype(np.float32),
        np.zeros(depth.shape, bool),
        normal,
    )
    wall = np.abs(directions[..., 0]) > 0.06
    inner = wall[:-1] & wall[1:]
    inner &= np.roll(inner, -1, axis=1)
    same_side = np.sign(directions[:-1, :, 0]) == np.sign(np.roll(directions[:-1, :, 0], -1, 1))
    mesh = depth_mesh(frame)
    used = np.isin(np.arange(64 * 128), mesh.triangles).reshape(64, 128)
    assert used[:-1][inner & same_side].all()
    quads = (inner & same_side).sum()
    on_wall = wall.ravel()[np.minimum(mesh.triangles, 64 * 128 - 1)].all(axis=1)
    assert on_wall.sum() >= 2 * quads
