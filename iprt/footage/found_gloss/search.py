"""Gloss that nobody declared: which large planes of a frame reflect, found in its picture.

A plane is taken to be glossy only where the evidence is strong (`is_strong`); all others stay
diffuse. What is told best is a window's reflection in a floor of little texture. What cannot be
told: roughness above 0.35; reflections of surroundings that are evenly bright; metals and mirrors,
which show nothing of their own; curved things; gloss that only a part of a plane has.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from iprt.footage.cell_planes import PARALLEL, CellPlane, find_planes
from iprt.footage.cells import Cells, cell_means
from iprt.footage.found_gloss.coat_reflection import IOR, KINDS
from iprt.footage.found_gloss.evidence import ALPHAS, Reflection
from iprt.footage.found_gloss.frames import Followed, Moment
from iprt.footage.frame import Frame
from iprt.footage.real_material import Evidence, Plane, RealMaterial
from iprt.footage.threads import on_all_cores
from iprt.geometry.material import Material

ROWS = 128
"""Rows of cells."""
MIN_TOLERANCE, NOISE = 0.002, 3.0
"""Least distance from a plane of what is on it, over depth, and the same in `Frame.fit_tolerance`.
"""
SCREEN, SCREEN_RAYS, MIN_SCREEN_T = (1, 4), 4, 3.0
"""Which of `ALPHAS` are tried first, without the shading, with how many rays, and the least t to
look further."""
MIN_T, MAX_CHANCE = 8.0, 1e-3
"""Least t of a reflection, and largest probability that chance would show it somewhere. Shading
that the panorama does not explain reaches t = 6 in rooms of matte surfaces."""
STRENGTH = (0.25, 2.0)
"""Strengths over that of an index of 1.5 that are believed: those of indices from 1.2 to 1.8, and
windows whose sky is brighter or darker where the camera did not see it."""
MAX_RECOVERED = 10.0
"""The largest one of what the picture shows clipped, which is recovered up to five times too dark.
"""
MAX_ALPHA = 0.35
"""Shading that the panorama does not explain looks like reflections rougher than this."""
MAX_BEYOND = 0.3
"""Largest share of cells whose reflection would be more than was seen."""
FLAKE = 0.03
"""Distance from a larger plane, over depth, of what is a piece of it: errors of depth set it off.
Such a piece is scattered, and its cells' neighbours belong to the other."""
UPRIGHT = 0.9
"""Least cosine with the vertical of floors, tops and ceilings."""


def find_gloss(
    frame: Frame, taken: frozenset[str] = frozenset(), later: Iterable[Frame] = ()
) -> tuple[RealMaterial, ...]:
    """The planes that reflect; `taken` are names that others have.

    Parameters
    ----------
    frame : Frame
        Sanitised, its clipped lights recovered. Cells of which a part is known to be glossy
        (`Frame.gloss`) are left out.
    later : iterable of Frame
        Others of the video; those from another place than the first count (`frames`).
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
    for plane, reflection in zip(planes, on_all_cores(_reflection, followed), strict=True):
        if reflection and is_strong(reflection, len(planes) * len(ALPHAS) * KINDS):
            names = taken | {material.name for material in found}
            name = _free_name(_kind(plane, planes), names)
            found.append(_material(name, cells, plane, tolerance, reflection))
    return tuple(found)


def is_strong(reflection: Reflection, tries: int) -> bool:
    """Whether the evidence of a reflection, the best of so many tries, is believed."""
    fit = reflection.fit
    most = MAX_RECOVERED if fit.recovered else STRENGTH[1]
    return (
        fit.t >= MIN_T
        and fit.chance(tries) <= MAX_CHANCE
        and reflection.alpha <= MAX_ALPHA
        and STRENGTH[0] <= fit.strength <= most
        and fit.beyond <= MAX_BEYOND
    )


def without_flakes(cells: Cells, planes: list[CellPlane]) -> list[CellPlane]:
    """Those that are not pieces of an earlier, larger one."""
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


def _reflection(plane: Followed) -> Reflection | None:
    """Gather the evidence of a plane's reflection; None where nothing looks like one."""
    if not _worth_a_look(plane):
        return None
    parts = [plane.reflected(alpha, index) for index, alpha in enumerate(ALPHAS)]
    return plane.picture().reflection(parts)


def _worth_a_look(plane: Followed) -> bool:
    """Whether anything goes with its reflections, shading or not: most walls end here."""
    picture = plane.picture(shaded=False)
    for index in SCREEN:
        alpha = ALPHAS[index]
        fit = picture.fit(plane.reflected(alpha, index, SCREEN_RAYS), alpha)
        if fit.t >= MIN_SCREEN_T and fit.strength >= STRENGTH[0]:
            return True
    return False


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
    """What to call a plane: the lowest that looks up is the floor."""
    if plane.normal[1] > UPRIGHT:
        lowest = min(other.offset for other in planes if other.normal[1] > UPRIGHT)
        return "floor" if plane.offset <= lowest else "top"
    return "ceiling" if plane.normal[1] < -UPRIGHT else "wall"


def _free_name(wanted: str, taken: frozenset[str]) -> str:
    numbered = (wanted, *(f"{wanted}_{number}" for number in range(2, len(taken) + 3)))
    return next(name for name in numbered if name not in taken)
