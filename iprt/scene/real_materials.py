"""The glossy real surfaces of a scene: those it declares, and others that are found and cached."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from iprt.device.kept import kept
from iprt.errors import FormatError
from iprt.files.images import read_color
from iprt.files.safe_reading import MAX_PIXELS
from iprt.files.toml_tables import Ior, Table, Unit
from iprt.footage.prepare.reading import RawFrame, RawFrames
from iprt.footage.prepare.stages import Preparation
from iprt.footage.real_material import (
    MAX_REAL_MATERIALS,
    Doubt,
    Evidence,
    GlossSearch,
    Plane,
    RealMaterial,
)
from iprt.footage.video.source import FrameSource
from iprt.geometry.material import Material
from iprt.scene.manifest import Manifest

Mask = NDArray[np.bool_]

LOG = logging.getLogger("iprt.scene")
MIN_HEIGHT = 64
"""Least number of rows of a panorama in which reflections can be detected."""
FRAMES = 5
"""Number of frames to search in a video with a moving camera."""


def declared_materials(root: Path, manifest: Manifest) -> tuple[RealMaterial, ...]:
    """Return the `[[real_materials]]` of a scene in the folder `root`, in the manifest's order.

    Raises
    ------
    FormatError
        A mask cannot be read or is not twice as wide as high, or the masks are too large in total.
    """
    masks: dict[str, Mask] = {}
    for table in manifest.real_materials:
        if table.mask is not None and table.mask not in masks:
            masks[table.mask] = _mask(root / table.mask, manifest.video.yaw_offset_deg)
        if sum(mask.size for mask in masks.values()) > MAX_PIXELS:
            raise FormatError(
                f"{manifest.name}: its masks have more than the {MAX_PIXELS} pixels that are read"
            )
    return tuple(
        table.real_material(None if table.mask is None else masks[table.mask])
        for table in manifest.real_materials
    )


def _mask(path: Path, yaw_offset_deg: float) -> Mask:
    """Read a mask (h, w), rotated like the pictures of `[video]`."""
    mask = (read_color(path) > 0.0).any(axis=-1)
    height, width = mask.shape
    if width != 2 * height:
        raise FormatError(
            f"{path}: {width} x {height} pixels; a mask covers the whole panorama and is twice "
            "as wide as high"
        )
    columns = yaw_offset_deg / 360.0 * width
    return np.roll(mask, int(np.floor(columns + 0.5)), axis=1)


class _Kept(Table):
    """A surface in the cache; fields as in `RealMaterial`."""

    name: Annotated[str, Field(pattern=r"^[a-z]+(_[0-9]+)?$")]
    alpha: Unit
    ior: Ior
    plane: Plane
    evidence: Evidence

    @classmethod
    def of(cls, found: RealMaterial) -> _Kept:
        assert found.plane is not None
        assert found.evidence is not None
        alpha, ior = found.material.alpha, found.material.ior
        return cls(
            name=found.name, alpha=alpha, ior=ior, plane=found.plane, evidence=found.evidence
        )

    def material(self) -> RealMaterial:
        coat = Material("plastic", alpha=self.alpha, ior=self.ior)
        return RealMaterial(self.name, coat, plane=self.plane, evidence=self.evidence)


class _Result(Table):
    """A `GlossSearch` in the cache."""

    found: list[_Kept]
    doubts: tuple[Doubt, ...]


def searched_gloss(
    frames: RawFrames, manifest: Manifest, declared: tuple[RealMaterial, ...]
) -> GlossSearch:
    """Return the undeclared glossy surfaces that `find_gloss` finds in a scene, and its doubts.

    Results are kept (`iprt.device.kept`), for the table `[video]`, the declarations, and sizes and
    times of the frames' files: videos are long. An unreadable frame is no error, but reported where
    it is needed.
    """
    source = frames.source
    video = manifest.video.model_dump_json(exclude={"gloss", "sun", "sky"})
    inputs = [video, declared, file_states(source)]
    try:
        if source.size[1] < MIN_HEIGHT:
            return GlossSearch()
        found = kept("gloss", __name__, inputs, lambda: _searched(frames, declared))
    except FormatError:
        return GlossSearch()
    result = _Result.model_validate_json(found["json"].tobytes())
    materials = tuple(entry.material() for entry in result.found)
    return GlossSearch(materials[: MAX_REAL_MATERIALS - len(declared)], result.doubts)


def _searched(frames: RawFrames, declared: tuple[RealMaterial, ...]) -> dict[str, Any]:
    """Return the result of `find_gloss`, as `_Result` in JSON, for `kept`."""
    from iprt.footage.found_gloss.search import find_gloss

    source = frames.source
    raw = frames.read(source.indices[0])
    LOG.info("looking for glossy surfaces, once for this footage")
    prepare = Preparation(source.white, declared)
    names = frozenset(material.name for material in declared)
    search = find_gloss(prepare(raw), names, prepare.frames(_later(frames)))
    result = _Result(found=[_Kept.of(one) for one in search.found], doubts=search.doubts)
    return {"json": np.frombuffer(result.model_dump_json().encode(), np.uint8)}


def _looked_at(source: FrameSource) -> list[int]:
    """Return evenly spaced frames of a video with a moving camera, else only the first frame."""
    indices = source.indices
    if source.pose(indices[0]) is None:
        return [indices[0]]
    chosen = np.unique(np.linspace(0, len(indices) - 1, FRAMES).astype(int))
    return [indices[number] for number in chosen]


def _later(frames: RawFrames) -> Iterator[RawFrame]:
    """Yield the searched frames after the first."""
    for index in _looked_at(frames.source)[1:]:
        with suppress(FormatError):
            yield frames.read(index)


def file_states(source: FrameSource) -> list[str]:
    """Return paths, sizes and times of the searched files."""
    files = {file for index in _looked_at(source) for file in source.files(index).values()}
    states = []
    for file in sorted(files):
        with suppress(OSError):
            status = file.stat()
            states.append(f"{file.resolve()} {status.st_size} {status.st_mtime_ns}")
    return states
