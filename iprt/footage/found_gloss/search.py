"""Search for undeclared gloss: large planes of a frame that reflect their surroundings.

A plane counts as glossy only if the evidence is strong (`doubt_of`); all others stay diffuse. A
window's reflection in a floor with little texture is the easiest to detect. Not detectable are
roughness above 0.35, reflections of evenly bright surroundings, metals and mirrors, which have no
diffuse reflection, curved surfaces, and gloss on only a part of a plane.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cell_planes import PARALLEL, CellPlane, find_planes, on_finer_cells
from iprt.footage.cells import Cells, cell_means
from iprt.footage.coat_reflection import IOR, KINDS, RoomCells
from iprt.footage.found_gloss.evidence import ALPHAS, Reflection, resolved
from iprt.footage.found_gloss.followed_planes import FINEST, Followed, Moment
from iprt.footage.frame import Frame
from iprt.footage.real_material import Doubt, Evidence, GlossSearch, Plane, RealMaterial
from iprt.footage.received_light import finer
from iprt.footage.threads import on_all_cores
from iprt.geometry.material import Material

ROWS, MIN_CELLS = 128, 1500
"""Number of rows of cells, and number of cells below which a plane is judged in finer ones: the
image of a window in a table top is a few degrees wide."""
TOLERANCE, SMALL_TOLERANCE, NOISE = 0.002, 0.004, 3.0
"""Tolerance of the distance from a plane: least values relative to depth, for large and for small
planes, and in units of `Frame.fit_tolerance`. Objects stand on small planes; pictures hang flat on
walls."""
SCREEN, SCREEN_RAYS, MIN_SCREEN_T = (0.05, 0.2), 4, 3.0
"""Screening: roughnesses, rays per cell, and least t to go on."""
MIN_T, MAX_CHANCE = 7.0, 1e-3
"""Least t of a reflection, and largest probability of a chance result on any plane."""
SHARP = 0.2
"""Roughness up to which `MIN_T` suffices: shading that the panorama does not explain looks like
rougher reflections, with t of up to 10 in rooms of matte surfaces."""
STRENGTH = (0.25, 2.0)
"""Plausible strengths relative to an index of 1.5. They cover indices from 1.2 to 1.8, and windows
with a brighter or darker sky outside the camera's view."""
MAX_RECOVERED = 10.0
"""Largest plausible strength for light recovered from clipped texels, which may be five times too
dark."""
MAX_ALPHA = 0.35
"""Largest roughness; unexplained shading looks like rougher reflections."""
FLAKE = 0.03
"""Distance from a larger plane, relative to depth, within which a plane in pieces is a fragment of
it, caused by errors of depth. A board on a wall is in one piece."""
CONNECTED = 0.7
"""Least share of a small plane that one piece of it has, across gaps of up to 2.8 degrees."""
UPRIGHT = 0.9
"""Least absolute cosine between the vertical and the normals of floors, tops and ceilings."""


def find_gloss(
    frame: Frame, taken: frozenset[str] = frozenset(), later: Iterable[Frame] = ()
) -> GlossSearch:
    """Find the planes that reflect.

    Parameters
    ----------
    frame : Frame
        Sanitized, with recovered clipped lights. Cells with known gloss (`Frame.gloss`) are left
        out.
    taken : frozenset of str
        Names that are in use already.
    later : iterable of Frame
        Other frames of the video. Only frames from another place than the first one count
        (`frames`).

    Returns
    -------
    GlossSearch
        Found are the planes with strong evidence.
    """
    first = Moment(frame, frame)
    followed = _planes(frame, first)
    planes = [view.plane for view in followed]
    for other in later if planes else ():
        moment = Moment(other, frame)
        if moment.motion is not None:
            for view in followed:
                view.follow(moment)
    found: list[RealMaterial] = []
    doubts: list[Doubt] = []
    names = taken
    for view in followed:
        plane, cells, seen = view.plane, view.cells, _reflection(view)
        name = _free_name(_kind(plane, planes), names)
        names |= {name}
        reason: str | None
        if isinstance(seen, Reflection):
            reason = doubt_of(seen, len(planes) * len(ALPHAS) * KINDS)
            if reason is None:
                found.append(_material(name, cells, plane, seen))
                continue
        else:
            reason = seen
        x, y, z = cells.direction[plane.cells].mean(axis=0)
        yaw, pitch = np.rad2deg([np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))])
        doubts.append(Doubt(name, round(float(yaw)), round(float(pitch)), reason))
    return GlossSearch(tuple(found), tuple(doubts))


def _planes(frame: Frame, first: Moment) -> list[Followed]:
    """Return the planes of a frame, each in cells that are fine enough for it.

    Small planes are found in cells of half the width, as objects cover much of a table top.
    """
    rows, noise = min(ROWS, frame.height), NOISE * frame.fit_tolerance
    passes = [(rows, max(TOLERANCE, noise)), (2 * rows, max(SMALL_TOLERANCE, noise))]
    taken = np.zeros((rows, 2 * rows), bool)
    kept: list[CellPlane] = []
    followed = []
    for each, tolerance in passes[: 1 + (2 * rows <= frame.height)]:
        around = first.around(each)
        usable = _usable(frame, around) & ~finer(taken, each).ravel()
        for plane in find_planes(around.cells, tolerance, usable):
            if is_flake(around.cells, plane, kept):
                continue
            if each == rows:
                taken.ravel()[plane.cells] = True
            kept.append(plane)
            followed.append(_in_fine_cells(frame, first, plane, each))
    return followed


def _in_fine_cells(frame: Frame, first: Moment, plane: CellPlane, rows: int) -> Followed:
    """Return a plane of `rows` rows of cells in cells of which it has enough."""
    count, fine = len(plane.cells), rows
    while count < MIN_CELLS and 2 * fine <= min(FINEST, frame.height):
        count, fine = 4 * count, 2 * fine
    if fine > rows:
        there = first.around(fine)
        plane = on_finer_cells(plane, there.cells, _usable(frame, there))
    return Followed(first, plane, fine)


def _usable(frame: Frame, around: RoomCells) -> NDArray[np.bool_]:
    """Return (N,) bool: the cells that are lit, and of no known gloss."""
    usable: NDArray[np.bool_] = around.color.min(axis=-1) > 0.0
    if frame.gloss is not None:
        usable &= cell_means(frame.gloss > 0, around.cells.rows).ravel() == 0.0
    return usable


def doubt_of(reflection: Reflection, tries: int) -> str | None:
    """Return why a reflection is not believed, the best of `tries`; None if it is."""
    fit = reflection.fit
    most = MAX_RECOVERED if fit.recovered else STRENGTH[1]
    least = MIN_T * max(1.0, reflection.alpha / SHARP) ** 2
    if fit.t < least:
        return f"weak evidence of a reflection (t = {fit.t:.1f}, of {least:.0f} at least)"
    if fit.chance(tries) > MAX_CHANCE:
        return f"a reflection on a small part of it (t = {fit.t:.1f}), which may be chance"
    if reflection.alpha > MAX_ALPHA:
        return f"a reflection of alpha {reflection.alpha:.2f}, which may be shading"
    if fit.strength < STRENGTH[0]:
        return f"a reflection of {fit.strength:.2g} of a coat's strength, which may be shading"
    if fit.strength > most:
        return f"a reflection of {fit.strength:.1f} times a coat's strength, which no coat has"
    return None


def is_scattered(cells: Cells, plane: CellPlane) -> bool:
    """Return whether no connected piece has most of a plane, as among folds of cloth."""
    columns = 2 * cells.rows
    on = np.zeros((cells.rows, columns), bool)
    on.ravel()[plane.cells] = True
    beside = np.ones((3, 3), bool)
    gap = max(1, cells.rows // ROWS)
    grown = scipy.ndimage.binary_dilation(np.tile(on, 2), beside, gap)
    piece = scipy.ndimage.label(grown, beside)[0][:, :columns].ravel()[plane.cells]
    area = np.bincount(piece, cells.solid_angle[plane.cells])
    return bool(area.max() < CONNECTED * area.sum())


def is_flake(cells: Cells, plane: CellPlane, larger: list[CellPlane]) -> bool:
    """Return whether a plane is a fragment of a larger one."""
    point, depth = cells.point[plane.cells], cells.depth[plane.cells]
    return is_scattered(cells, plane) and any(
        plane.normal @ other.normal > PARALLEL
        and np.median(np.abs(point @ other.normal - other.offset) / depth) < FLAKE
        for other in larger
    )


def _reflection(plane: Followed) -> Reflection | str:
    """Gather the evidence of a plane's reflection; the reason if it is not worth it."""
    if plane.cells.rows > ROWS and is_scattered(plane.cells, plane.plane):
        return "it lies in pieces, as errors of depth and folds of cloth do"
    coats = [plane.reflected(alpha, seed, SCREEN_RAYS) for seed, alpha in enumerate(SCREEN)]
    for shaded in (False, True):  # most walls show no sign of a reflection even without shading
        picture = plane.picture(shaded=shaded)
        fits = [picture.fit(coat, alpha) for coat, alpha in zip(coats, SCREEN, strict=True)]
        t = max((fit.t for fit in fits if fit.strength >= STRENGTH[0]), default=0.0)
        if t < MIN_SCREEN_T:
            return f"no sign of a reflection (t = {t:.1f})"
    numbered = list(enumerate(resolved(plane.cells.rows)))
    parts = on_all_cores(lambda one: plane.reflected(one[1], one[0]), numbered)
    return picture.reflection(parts)


def _material(name: str, cells: Cells, plane: CellPlane, reflection: Reflection) -> RealMaterial:
    fit = reflection.fit
    x, y, z = (round(float(value), 5) for value in plane.normal)
    u, v, w = (round(float(value), 5) for value in plane.offset * plane.normal)
    reach = plane.tolerance * float(np.median(cells.depth[plane.cells]))
    evidence = Evidence(
        t=fit.t,
        strength=fit.strength,
        error=fit.error,
        low=reflection.alpha / reflection.spread,
        high=reflection.alpha * reflection.spread,
    )
    coat = Material("plastic", alpha=round(reflection.alpha, 3), ior=IOR)
    return RealMaterial(
        name, coat, plane=Plane((u, v, w), (x, y, z), round(reach, 5)), evidence=evidence
    )


def _kind(plane: CellPlane, planes: list[CellPlane]) -> str:
    """Return a name for a plane: the lowest one that faces up is the floor."""
    if plane.normal[1] > UPRIGHT:
        lowest = min(other.offset for other in planes if other.normal[1] > UPRIGHT)
        return "floor" if plane.offset <= lowest else "top"
    return "ceiling" if plane.normal[1] < -UPRIGHT else "wall"


def _free_name(wanted: str, taken: frozenset[str]) -> str:
    numbered = (wanted, *(f"{wanted}_{number}" for number in range(2, len(taken) + 3)))
    return next(name for name in numbered if name not in taken)
