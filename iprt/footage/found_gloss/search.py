"""Search for undeclared gloss: large planes of a frame that reflect their surroundings.

A plane counts as glossy only if the evidence is strong (`doubt_of`); all others stay diffuse. A
window's reflection in a floor with little texture is the easiest to detect. Not detectable are
roughness above 0.35, reflections of evenly bright surroundings, metals and mirrors, which have no
diffuse reflection, curved surfaces, and gloss on only a part of a plane.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from iprt.footage.cell_planes import PARALLEL, CellPlane, find_planes
from iprt.footage.cells import Cells, cell_means
from iprt.footage.found_gloss.coat_reflection import IOR, KINDS
from iprt.footage.found_gloss.evidence import ALPHAS, Reflection
from iprt.footage.found_gloss.followed_planes import Followed, Moment
from iprt.footage.frame import Frame
from iprt.footage.real_material import Doubt, Evidence, GlossSearch, Plane, RealMaterial
from iprt.footage.threads import on_all_cores
from iprt.geometry.material import Material

ROWS = 128
"""Number of rows of cells."""
MIN_TOLERANCE, NOISE = 0.002, 3.0
"""Tolerance of the distance from a plane: least value relative to depth, and in units of
`Frame.fit_tolerance`."""
SCREEN, SCREEN_RAYS, MIN_SCREEN_T = (1, 4), 4, 3.0
"""Screening without shading: indices into `ALPHAS`, rays per cell, and least t to go on."""
MIN_T, MAX_CHANCE = 8.0, 1e-3
"""Least t of a reflection, and largest probability of a chance result on any plane. Shading that is
not explained by the panorama reaches t = 6 in rooms of matte surfaces."""
STRENGTH = (0.25, 2.0)
"""Plausible strengths relative to an index of 1.5. They cover indices from 1.2 to 1.8, and windows
with a brighter or darker sky outside the camera's view."""
MAX_RECOVERED = 10.0
"""Largest plausible strength for light recovered from clipped texels, which may be five times too
dark."""
MAX_ALPHA = 0.35
"""Largest roughness; unexplained shading looks like rougher reflections."""
MAX_BEYOND = 0.3
"""Largest share of cells whose predicted reflection exceeds their radiance."""
FLAKE = 0.03
"""Distance from a larger plane, relative to depth, within which a plane is a fragment of it, caused
by errors of depth. The cells of such a fragment are scattered among the larger plane's."""
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
    first = Moment.of(frame, min(ROWS, frame.height), frame)
    cells = first.around.cells
    tolerance = max(MIN_TOLERANCE, NOISE * frame.fit_tolerance)
    usable = first.around.color.min(axis=-1) > 0.0
    if frame.gloss is not None:
        usable &= cell_means(frame.gloss > 0, cells.rows).ravel() == 0.0
    planes = without_flakes(cells, find_planes(cells, tolerance, usable))
    followed = [Followed(first, plane) for plane in planes]
    for other in later if planes else ():
        moment = Moment.of(other, cells.rows, frame)
        if moment.motion is not None:
            for view in followed:
                view.follow(moment, other, tolerance)
    found: list[RealMaterial] = []
    doubts: list[Doubt] = []
    names = taken
    for plane, seen in zip(planes, on_all_cores(_reflection, followed), strict=True):
        name = _free_name(_kind(plane, planes), names)
        names |= {name}
        if isinstance(seen, Reflection):
            reason = doubt_of(seen, len(planes) * len(ALPHAS) * KINDS)
            if reason is None:
                found.append(_material(name, cells, plane, tolerance, seen))
                continue
        else:
            reason = f"no sign of a reflection (t = {seen:.1f})"
        x, y, z = cells.direction[plane.cells].mean(axis=0)
        yaw, pitch = np.rad2deg([np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))])
        doubts.append(Doubt(name, round(float(yaw)), round(float(pitch)), reason))
    return GlossSearch(tuple(found), tuple(doubts))


def doubt_of(reflection: Reflection, tries: int) -> str | None:
    """Return why a reflection is not believed, the best of `tries`; None if it is."""
    fit = reflection.fit
    most = MAX_RECOVERED if fit.recovered else STRENGTH[1]
    if fit.t < MIN_T or fit.chance(tries) > MAX_CHANCE:
        return f"weak evidence of a reflection (t = {fit.t:.1f}, of {MIN_T:g} at least)"
    if reflection.alpha > MAX_ALPHA:
        return f"a reflection of alpha {reflection.alpha:.2f}, which may be shading"
    if fit.strength < STRENGTH[0]:
        return f"a reflection of {fit.strength:.2g} of a coat's strength, which may be shading"
    if fit.strength > most:
        return f"a reflection of {fit.strength:.1f} times a coat's strength, which no coat has"
    if fit.beyond > MAX_BEYOND:
        return f"a reflection that would be brighter than {fit.beyond:.0%} of the surface is"
    return None


def without_flakes(cells: Cells, planes: list[CellPlane]) -> list[CellPlane]:
    """Return the planes that are no fragments of an earlier, larger one."""
    kept: list[CellPlane] = []
    for plane in planes:
        point, depth = cells.point[plane.cells], cells.depth[plane.cells]
        if not any(
            plane.normal @ other.normal > PARALLEL
            and np.median(np.abs(point @ other.normal - other.offset) / depth) < FLAKE
            for other in kept
        ):
            kept.append(plane)
    return kept


def _reflection(plane: Followed) -> Reflection | float:
    """Gather the evidence of a plane's reflection; t of the screening if that finds none."""
    t = _screened(plane)
    if t < MIN_SCREEN_T:
        return t
    parts = [plane.reflected(alpha, index) for index, alpha in enumerate(ALPHAS)]
    return plane.picture().reflection(parts)


def _screened(plane: Followed) -> float:
    """Return t of the correlation of a plane's picture and its reflections; 0 if they are weak.

    Most walls have none.
    """
    picture, best = plane.picture(shaded=False), 0.0
    for index in SCREEN:
        alpha = ALPHAS[index]
        fit = picture.fit(plane.reflected(alpha, index, SCREEN_RAYS), alpha)
        if fit.strength >= STRENGTH[0]:
            best = max(best, fit.t)
    return best


def _material(
    name: str, cells: Cells, plane: CellPlane, tolerance: float, reflection: Reflection
) -> RealMaterial:
    fit = reflection.fit
    x, y, z = (round(float(value), 5) for value in plane.normal)
    u, v, w = (round(float(value), 5) for value in plane.offset * plane.normal)
    reach = tolerance * float(np.median(cells.depth[plane.cells]))
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
