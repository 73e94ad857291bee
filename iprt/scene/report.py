"""Statistics of a scene, for `iprt scene info` and `iprt scene check`."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from iprt.errors import IprtError
from iprt.files.images import picture_size
from iprt.files.toml_tables import problems_error
from iprt.footage.depth_summary import DepthSummary, normal_warnings
from iprt.footage.frame import Frame
from iprt.footage.lights.summary import Recovered
from iprt.footage.prepare.openings import holes_of
from iprt.footage.prepare.reading import RawFrame
from iprt.footage.prepare.remarks import depth_doubts, video_notices
from iprt.footage.prepare.steady import bad_frames
from iprt.footage.video.picture_tracks import frame_path
from iprt.footage.video.tracks import depth_code
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, transformed
from iprt.scene.light_report import LightReport, Share, Shares, describe_light
from iprt.scene.light_tables import described
from iprt.scene.manifest import MANIFEST_NAME
from iprt.scene.objects import SceneObject
from iprt.scene.placement import RealSurfaces
from iprt.scene.scene import Scene


@dataclass(frozen=True)
class ObjectReport:
    """Statistics of an object.

    They are its triangles and materials, or its `light`; its initial size in metres, its motion,
    unread contents of its file, and faults of its placement.
    """

    name: str
    triangles: int
    materials: tuple[str, ...]
    light: str | None
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    moves: tuple[str, ...]
    dropped: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class SceneReport(LightReport):
    """Statistics of a scene; depth percentiles in metres.

    `depth_unit` describes the encoding of depth. `unlikely` lists doubtful facts about depth and
    normals, a phrase each.
    """

    name: str
    width: int
    height: int
    frames: tuple[int, int]
    fps: float
    exposure: float
    depth_unit: str
    surroundings: DepthSummary | None
    unlikely: tuple[str, ...]
    depth_percentiles: dict[str, float]
    radiance_percentiles: dict[str, float]
    holes: Share
    openings: Share
    open_sky: Share
    dropouts: Share
    clipped: Recovered | None
    normals: str
    objects: tuple[ObjectReport, ...]
    views: dict[str, dict[str, Any]]

    def record(self) -> dict[str, Any]:
        """Return plain values for JSON; depth percentiles are None if there is no depth."""
        record = asdict(self)
        if any(np.isnan(value) for value in self.depth_percentiles.values()):
            record["depth_percentiles"] = None
        return record


def describe_scene(scene: Scene, frame: Frame, raw: RawFrame) -> SceneReport:
    """Compute the statistics of a scene.

    Parameters
    ----------
    frame, raw : Frame, RawFrame
        The first frame, sanitised and as read.
    """
    measured = np.isfinite(raw.depth) & (raw.depth > 0.0)
    picture = frame.picture
    holes = holes_of(raw.depth, measured, picture)
    shares = Shares.of(frame)
    surfaces = RealSurfaces(frame)
    place = surroundings_of(scene, raw)
    return SceneReport(
        **vars(describe_light(scene, frame, shares)),
        name=scene.name,
        width=frame.width,
        height=frame.height,
        frames=(scene.frame_indices[0], scene.frame_indices[-1]),
        fps=scene.source.fps,
        exposure=scene.exposure,
        depth_unit=depth_code(scene.manifest.video).describe(),
        surroundings=place,
        unlikely=tuple(unlikely(scene, raw, place)),
        depth_percentiles=_percentiles(raw.depth[measured], (1, 50, 99)),
        radiance_percentiles=_percentiles(picture, (1, 50, 99, 100)),
        holes=shares.within(~measured),
        openings=shares.within(holes.opening),
        open_sky=shares.within(holes.open_sky),
        dropouts=shares.within(holes.dropout),
        clipped=Recovered.of(frame, scene.source.white),
        normals="fitted to the depth" if raw.normal is None else "given",
        objects=tuple(
            _describe_object(instance, entry, surfaces)
            for instance, entry in zip(scene.instances, scene.objects, strict=True)
        ),
        views={
            name: {
                "width": entry.view.width,
                "height": entry.view.height,
                "yaw_deg": entry.view.yaw_deg,
                "pitch_deg": entry.view.pitch_deg,
                "fov_y_deg": entry.view.fov_y_deg,
                "objects": list(entry.objects),
                "truth": entry.truth is not None,
                "moves": None if entry.motion is None else entry.motion.describe(),
            }
            for name, entry in scene.views.items()
        },
    )


def surroundings_of(scene: Scene, raw: RawFrame) -> DepthSummary | None:
    """Estimate the kind of place from a raw frame; None if it has no depth."""
    return DepthSummary.of(raw.depth, is_cube=scene.source.code.kind == "cube")


def unlikely(scene: Scene, raw: RawFrame, place: DepthSummary | None) -> list[str]:
    """Return guesses and doubts about the depth and normals of a raw frame, a phrase each."""
    found = depth_doubts(scene.raw_frames)
    found += [] if place is None else [f"depth: {phrase}" for phrase in place.warnings()]
    if raw.normal is not None:
        found += [f"normals: {phrase}" for phrase in normal_warnings(raw.normal, raw.depth)]
    return found


def check_files(scene: Scene) -> list[str]:
    """Read every file that the scene names.

    Returns
    -------
    list of str
        Warnings, a line each: unreadable frames after the first and inconsistent streams, for which
        the video reader compensates, and outdated truths.

    Raises
    ------
    SceneError
        There are problems, listed a line each.
    """
    problems: list[str] = []
    _collect(problems, scene, scene.raw_frame)
    warnings = video_notices(scene.source) + ([] if problems else bad_frames(scene.raw_frames))
    warnings = [warning.replace(f"{scene.root}{os.sep}", "") for warning in warnings]
    _collect(problems, scene, lambda: scene.real_materials)
    _collect(problems, scene, lambda: scene.instances)
    problems += _truth_problems(scene)
    warnings += [entry.truth_warning for entry in scene.views.values() if entry.truth_warning]
    if problems:
        raise problems_error(str(scene.root / MANIFEST_NAME), problems + warnings)
    return warnings


def _truth_problems(scene: Scene) -> list[str]:
    problems: list[str] = []
    for entry in scene.views.values():
        expected = (entry.view.width, entry.view.height)
        for key in ("truth", "truth_background", "truth_mask"):
            pattern = getattr(entry, key)
            paths = [] if pattern is None else _frames_of(scene, str(pattern))
            for path in paths:
                size = _collect(problems, scene, partial(picture_size, path))
                if size is not None and size != expected:
                    problems.append(
                        f"views.{entry.name}.{key}: {path.name} has {size[0]} x {size[1]} "
                        f"pixels, but size = [{expected[0]}, {expected[1]}]"
                    )
    return problems


def _frames_of(scene: Scene, pattern: str) -> list[Any]:
    paths = (frame_path(scene.root, pattern, index) for index in scene.frame_indices)
    return [path for path in dict.fromkeys(paths) if path.is_file()]


def _collect(problems: list[str], scene: Scene, action: Callable[[], Any]) -> Any:
    """Return the result of `action`, or note its error with a short path and return None."""
    try:
        return action()
    except IprtError as error:
        problems.append(str(error).removeprefix(f"{scene.root}{os.sep}"))
        return None


def _material_name(material: Material) -> str:
    if material.emits:
        return "lamp"
    return "mirror" if material.is_mirror else material.kind


def _describe_object(
    instance: Instance, entry: SceneObject, surfaces: RealSurfaces
) -> ObjectReport:
    mesh = instance.mesh
    vertices = transformed(instance.to_world, mesh.positions.astype(np.float64))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return ObjectReport(
        name=instance.name,
        triangles=len(mesh.triangles),
        materials=tuple(map(_material_name, mesh.materials)),
        light=None if entry.light is None else described(entry.light.table),
        low=(float(low[0]), float(low[1]), float(low[2])),
        high=(float(high[0]), float(high[1]), float(high[2])),
        moves=entry.describe(),
        dropped=mesh.dropped,
        warnings=tuple(surfaces.placement_faults(instance)),
    )


def _percentiles(values: Any, at: tuple[int, ...]) -> dict[str, float]:
    if values.size == 0:
        return {f"p{p}": float("nan") for p in at}
    found = np.percentile(values, at)
    return {f"p{p}": float(value) for p, value in zip(at, found, strict=True)}
