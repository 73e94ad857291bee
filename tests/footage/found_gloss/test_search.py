"""Gloss that nobody declared: found where it is, with its roughness, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from iprt.footage.cell_planes import CellPlane, find_planes
from iprt.footage.cells import Cells, Geometry
from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.coat_reflection import (
    RECOVERED,
    Patch,
    RoomCells,
    radiance_along,
    reflected,
)
from iprt.footage.found_gloss.evidence import Fit, PlanePicture, Reflection, resolved
from iprt.footage.found_gloss.search import doubt_of, find_gloss, is_flake, is_scattered
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.footage.coated_rooms import coated_room, matte_room
from tests.frame.radiosity import ROOM
from tests.oracles.brdf import specular_albedo
from tests.worlds import Float, bright_walls, room_frame

ROWS = 96
"""Of rooms that are smaller than those in which rough coats are found."""


@pytest.mark.thorough
@pytest.mark.parametrize(("alpha", "rows", "factor"), [(0.05, ROWS, 1.5), (0.2, 128, 2.0)])
def test_a_floor_that_reflects_a_window_gets_its_roughness(
    alpha: float, rows: int, factor: float
) -> None:
    frame = coated_room(alpha, rows=rows)
    (floor,) = find_gloss(frame).found
    assert floor.name == "floor"
    assert alpha / factor < floor.material.alpha < factor * alpha
    assert floor.plane is not None
    assert np.dot(floor.plane.normal, (0.0, 1.0, 0.0)) > 0.9999
    np.testing.assert_allclose(floor.plane.point, (0.0, ROOM.low[1], 0.0), atol=2e-3)
    assert floor.evidence is not None
    assert 0.4 < floor.evidence.strength < 1.6
    region, down = floor.region(frame), frame.normal[..., 1] > 0.9
    assert region[down].mean() > 0.95
    assert not region[~down].any()


@pytest.mark.thorough
def test_a_matte_room_has_no_gloss() -> None:
    search = find_gloss(matte_room(rows=ROWS))
    assert search.found == ()
    doubts = {doubt.name: doubt for doubt in search.doubts}
    assert {"floor", "ceiling"} <= doubts.keys()
    assert doubts["floor"].pitch_deg < -80
    assert doubts["ceiling"].pitch_deg > 80
    assert all("reflection" in doubt.reason for doubt in search.doubts)


def clipped(frame: Frame, factor: float) -> Frame:
    """The window clipped by the camera, and recovered as `factor` times as bright as it is."""
    color = frame.color.copy()
    color[frame.opening] *= factor
    texel = np.flatnonzero(frame.opening).astype(np.int32)
    white = np.ones((len(texel), 3), np.float32)
    return replace(frame, color=color, clipped=ClippedTexels(texel, white))


@pytest.mark.thorough
def test_the_reflection_of_a_clipped_window_may_be_brighter_than_the_window_seems() -> None:
    factor, alpha = 0.2, 0.05
    (floor,) = find_gloss(clipped(coated_room(alpha, rows=ROWS), factor)).found
    assert floor.name == "floor"
    assert alpha / 1.5 < floor.material.alpha < 1.5 * alpha
    assert floor.evidence is not None
    assert 0.4 < floor.evidence.strength * factor < 1.6
    assert find_gloss(clipped(matte_room(rows=ROWS), factor)).found == ()


@pytest.mark.thorough
def test_what_is_declared_is_not_found_again() -> None:
    frame = coated_room(0.2)
    floor = (frame.fitted_normal[..., 1] > 0.9).astype(np.uint8)
    assert find_gloss(replace(frame, gloss=floor)).found == ()


def cells_around(frame: Frame, rows: int) -> RoomCells:
    return RoomCells.of(frame, Geometry.of(frame, rows), rows)


# Planes ---------------------------------------------------------------------------------------


def room_cells(rows: int = 64) -> Cells:
    return Cells.of(Geometry.of(ROOM.frame(2 * rows, rows), rows), rows)


def test_the_six_walls_of_a_room_are_its_planes() -> None:
    cells = room_cells()
    found = find_planes(cells, 0.002, np.ones(len(cells.depth), bool))
    wanted = {
        (axis, side): abs((ROOM.low, ROOM.high)[side][axis]) for axis in range(3) for side in (0, 1)
    }
    assert len(found) == 6
    for plane in found:
        axis = int(np.abs(plane.normal).argmax())
        assert abs(plane.normal[axis]) > 0.99999
        offset = wanted.pop((axis, int(plane.normal[axis] < 0.0)))
        assert plane.offset == pytest.approx(-offset, abs=1e-3)
    shown = np.concatenate([plane.cells for plane in found])
    assert len(np.unique(shown)) == len(shown)
    assert cells.solid_angle[shown].sum() > 0.85 * 4.0 * np.pi


@pytest.mark.parametrize(
    ("lift", "columns", "planes"), [(0.0, 64, 6), (0.015, 8, 6), (0.015, 128, 7), (0.3, 128, 7)]
)
def test_pieces_that_errors_of_depth_set_off_are_no_planes(
    lift: float, columns: int, planes: int
) -> None:
    """Strips of the floor lie higher, by so many metres: a table or a rug is a plane."""
    frame = ROOM.frame(256, 128)
    d = View(256, 128, projection="equirect").directions()
    raised = (frame.normal[..., 1] > 0.9) & (np.arange(256) % (2 * columns) < columns)
    raised &= d[..., 1] > -0.9  # strips meet at the nadir
    nearer = np.where(raised, 1.0 + lift / ROOM.low[1], 1.0)
    depth = np.asarray(frame.depth * nearer, np.float32)
    cells = Cells.of(Geometry.of(replace(frame, depth=depth), 128), 128)
    found = find_planes(cells, 0.002, np.ones(len(cells.depth), bool))
    assert len(found) == (6 if lift == 0.0 else 7)
    kept: list[CellPlane] = []
    for plane in found:
        if not is_flake(cells, plane, kept):
            kept.append(plane)
    assert len(kept) == planes


@pytest.mark.parametrize(("columns", "scattered"), [(256, False), (190, False), (16, True)])
def test_folds_that_happen_to_lie_on_one_plane_are_none(columns: int, scattered: bool) -> None:
    """Every other strip of the floor, so many columns wide, is the plane."""
    cells = room_cells(128)
    every = np.ones(len(cells.depth), bool)
    floor = next(p for p in find_planes(cells, 0.002, every) if p.normal[1] > 0.9)
    column = floor.cells % (2 * cells.rows)
    near = cells.direction[floor.cells, 1] > -0.9  # strips meet at the nadir
    piece = floor.cells[near & (column // columns % 2 == 0)]
    assert is_scattered(cells, replace(floor, cells=piece)) is scattered


# What is reflected ----------------------------------------------------------------------------


def floor_of(around: RoomCells) -> CellPlane:
    every = np.ones(len(around.depth), bool)
    return next(p for p in find_planes(around.cells, 0.002, every) if p.normal[1] > 0.9)


def test_rays_find_what_an_exact_intersection_finds() -> None:
    rng = np.random.default_rng(1)
    frame = room_frame(ROOM, 256, 128, bright_walls)
    around = cells_around(frame, 128)
    start = rng.uniform(0.9 * np.array(ROOM.low), 0.9 * np.array(ROOM.high), (500, 3))
    way = rng.normal(size=(500, 3))
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    t, normal, _ = ROOM.first_hit(start, way)
    wanted = bright_walls(start + t[:, None] * way, normal)
    error = np.abs(radiance_along(around, start, way).sum(0) - wanted).max(-1)
    assert np.median(error) < 0.03
    assert (error < 0.1).mean() > 0.9


@pytest.mark.parametrize("alpha", [0.05, 0.2])
def test_even_light_is_reflected_by_the_albedo_of_the_coat(alpha: float) -> None:
    frame = ROOM.frame(128, 64)
    around = cells_around(replace(frame, color=np.full_like(frame.color, 2.0)), 64)
    plane = floor_of(around)
    cosine = -(around.cells.direction[plane.cells] @ plane.normal)
    found = reflected(around, Patch.of(around.cells, plane), alpha, 0, rays=64).sum(0).mean(-1)
    material = Material("plastic", alpha=alpha, ior=1.5)
    for low, high in ((0.5, 0.6), (0.8, 0.9)):
        ring = (cosine > low) & (cosine < high)
        middle = float(cosine[ring].mean())
        albedo = specular_albedo(material, np.array([np.sqrt(1.0 - middle**2), 0.0, middle]))[0]
        assert found[ring].mean() == pytest.approx(2.0 * albedo, rel=0.05)


@pytest.mark.thorough
def test_what_is_clipped_is_reflected_apart() -> None:
    frame = matte_room()
    cells = [cells_around(other, 128) for other in (frame, clipped(frame, 1.0))]
    patch = Patch.of(cells[0].cells, floor_of(cells[0]))
    whole, apart = (reflected(around, patch, 0.1, 0) for around in cells)
    assert not whole[RECOVERED].any()
    np.testing.assert_allclose(apart.sum(0), whole.sum(0), rtol=1e-5, atol=1e-6)
    walls = replace(frame, color=np.where(frame.opening[..., None], np.float32(0.0), frame.color))
    unlit = reflected(cells_around(walls, 128), patch, 0.1, 0)
    np.testing.assert_allclose(apart[0], unlit[0], rtol=1e-5, atol=1e-6)
    assert apart[RECOVERED].max() > 0.1


# Evidence -------------------------------------------------------------------------------------


@cache
def parts_of(room: str) -> tuple[RoomCells, CellPlane, list[Float]]:
    """The room's cells, its floor, and what this reflects for each α; the window may be clipped."""
    around = cells_around(clipped(matte_room(), 1.0) if room == "clipped" else matte_room(), 128)
    plane = floor_of(around)
    patch = Patch.of(around.cells, plane)
    parts = [
        reflected(around, patch, alpha, index)[None] for index, alpha in enumerate(resolved(128))
    ]
    return around, plane, parts


def pictured(
    k: float, texture: float, seed: int = 0, gain: float | None = None
) -> tuple[Reflection, float]:
    """The evidence of a floor that shows k times a reflection beside its texture, and its α.

    With a gain, the window was clipped, and is so many times as bright as it is thought to be.
    """
    rng = np.random.default_rng(seed)
    around, plane, parts = parts_of("whole" if gain is None else "clipped")
    color = around.color.copy()
    shade = 1.0 + texture * rng.normal(size=(len(plane.cells), 1))
    lit, window = parts[2][0]
    shine = lit + window * (1.0 if gain is None else gain)
    color[plane.cells] = 0.3 * np.maximum(shade, 0.1) + k * shine
    even: Float = np.ones((1, len(plane.cells), 3))
    return PlanePicture(around.cells, plane.cells, color, even).reflection(parts), resolved(128)[2]


@pytest.mark.thorough
def test_the_strength_of_a_reflection_is_found_through_texture() -> None:
    found, alpha = pictured(0.7, 0.2)
    assert found.fit.strength == pytest.approx(0.7, abs=4.0 * found.fit.error + 0.05)
    assert found.fit.t > 8.0
    assert alpha / 1.6 < found.alpha < 1.6 * alpha
    assert doubt_of(found, 50) is None


@pytest.mark.thorough
def test_what_is_clipped_has_a_strength_of_its_own() -> None:
    found, alpha = pictured(0.7, 0.2, gain=6.0)
    assert found.fit.recovered
    assert found.fit.strength == pytest.approx(4.2, abs=4.0 * found.fit.error + 0.3)
    assert alpha / 1.6 < found.alpha < 1.6 * alpha
    assert doubt_of(found, 50) is None


@pytest.mark.thorough
@pytest.mark.parametrize(("share", "bounded"), [(0.2, False), (0.5, True)])
def test_a_reflection_is_no_brighter_than_most_of_the_surface(share: float, bounded: bool) -> None:
    """Mats without a coat cover a share of the floor. They may be darker than the reflection."""
    around, plane, parts = parts_of("whole")
    shine, covered = parts[2][0].sum(0), np.random.default_rng(0).random(len(plane.cells)) < share
    color = around.color.copy()
    color[plane.cells] = np.where(covered[:, None], 0.3 * shine, 0.05 + shine)
    even: Float = np.ones((1, len(plane.cells), 3))
    picture = PlanePicture(around.cells, plane.cells, color, even)
    varied, smooth = picture._varied(), picture._smooth(parts[2], resolved(128)[2])
    free, limited = (picture._fit(varied, smooth, bounded=each)[0] for each in (False, True))
    assert (limited.strength < free.strength) is bounded
    if bounded:
        assert limited.strength == pytest.approx(0.3, rel=0.1)
        assert limited.t < free.t


@pytest.mark.thorough
def test_texture_alone_is_no_evidence() -> None:
    """t is a Student's t: of many floors without a reflection, few have a large one."""
    found = [pictured(0.0, 0.2, seed)[0] for seed in range(3)]
    assert max(abs(one.fit.t) for one in found) < 5.0
    assert all(doubt_of(one, 50) for one in found)


def test_more_tries_need_a_smaller_chance() -> None:
    fit = Fit(strength=1.0, error=0.1, explained=0.5, blocks=10.0)
    assert fit.t == pytest.approx(10.0)
    assert fit.chance(50) == pytest.approx(50 * fit.chance(1))
    assert fit.chance(10**9) == 1.0


@pytest.mark.parametrize(
    "change",
    [{"strength": 3.0}, {"strength": 0.2, "error": 0.01}, {"error": 0.2}, {"blocks": 3.0}],
    ids=["too strong", "too weak", "unsure", "on a small part"],
)
def test_what_is_not_believed(change: dict[str, float]) -> None:
    fit = Fit(strength=1.0, error=0.05, explained=0.5, blocks=100)
    assert doubt_of(Reflection(0.1, 1.1, fit), 50) is None
    assert doubt_of(Reflection(0.1, 1.1, replace(fit, **change)), 50) is not None
    assert doubt_of(Reflection(0.4, 1.1, fit), 50) is not None


def test_what_is_clipped_may_be_brighter_than_it_is_recovered() -> None:
    fit = Fit(6.0, 0.5, explained=0.5, blocks=100, recovered=True)
    assert doubt_of(Reflection(0.1, 1.1, fit), 50) is None
    assert doubt_of(Reflection(0.1, 1.1, replace(fit, recovered=False)), 50) is not None
    assert doubt_of(Reflection(0.1, 1.1, replace(fit, strength=20.0)), 50) is not None
