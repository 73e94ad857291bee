"""The glossy real surfaces of a scene: those it declares, and others that are found and cached."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from iprt.device.caches import own_folder
from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.files.images import read_color
from iprt.files.safe_reading import MAX_PIXELS
from iprt.files.toml_tables import Ior, Table, Unit
from iprt.footage.found_gloss.search import find_gloss
from iprt.footage.prepare.reading import RawFrame, RawFrames
from iprt.footage.prepare.stages import Preparation
from iprt.footage.real_material import MAX_REAL_MATERIALS, Evidence, Plane, RealMaterial
from iprt.footage.video.source import FrameSource
from iprt.geometry.material import Material
from iprt.scene.manifest import Manifest

Mask = NDArray[np.bool_]

LOG = logging.getLogger("iprt.scene")
VERSION = 6
"""Raise this when `find_gloss` changes its results."""
MIN_HEIGHT = 64
"""Least number of rows of a panorama in which reflections can be detected."""
FRAMES = 5
"""Number of frames to search in a video with a moving camera."""
MOST_BYTES = 1 << 16


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


_ALL_KEPT = TypeAdapter(list[_Kept])


def found_materials(
    frames: RawFrames, manifest: Manifest, declared: tuple[RealMaterial, ...]
) -> tuple[RealMaterial, ...]:
    """Return the undeclared glossy surfaces that `find_gloss` finds in a scene.

    Results are cached in `~/.cache/iprt/gloss`. The key has the table `[video]`, the declarations,
    and sizes and times of the frames' files. An unwritable folder is not an error. Neither is an
    unreadable frame, which is reported where it is needed.
    """
    source = frames.source
    file = own_folder() / "gloss" / f"{_key(source, manifest)}.json"
    kept = _read(file)
    if kept is None:
        try:
            raw = frames.read(source.indices[0])
        except FormatError:
            return ()
        if raw.color.shape[0] < MIN_HEIGHT:
            return ()
        LOG.info("looking for glossy surfaces, once for this footage")
        prepare = Preparation(source.white, declared)
        names = frozenset(material.name for material in declared)
        kept = find_gloss(prepare(raw), names, prepare.frames(_later(frames)))
        with suppress(FormatError), replacing(file) as temporary:
            temporary.write_bytes(_ALL_KEPT.dump_json([_Kept.of(material) for material in kept]))
    return kept[: MAX_REAL_MATERIALS - len(declared)]


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


def _key(source: FrameSource, manifest: Manifest) -> str:
    video = manifest.video.model_dump_json(exclude={"gloss"})
    tables = [table.model_dump_json() for table in manifest.real_materials]
    digest = hashlib.blake2b(" ".join([str(VERSION), video, *tables]).encode(), digest_size=20)
    files = {file for index in _looked_at(source) for file in source.files(index).values()}
    for file in sorted(files):
        with suppress(OSError):
            status = file.stat()
            digest.update(f"\n{file.resolve()} {status.st_size} {status.st_mtime_ns}".encode())
    return digest.hexdigest()


def _read(file: Path) -> tuple[RealMaterial, ...] | None:
    """Read the cache; return None if the entry is missing or invalid."""
    try:
        with file.open("rb") as opened:
            text = opened.read(MOST_BYTES + 1)
        kept = _ALL_KEPT.validate_json(text)
    except (OSError, ValidationError):
        return None
    names = {entry.name for entry in kept}
    if len(text) > MOST_BYTES or len(names) < len(kept):
        return None
    return tuple(entry.material() for entry in kept)
