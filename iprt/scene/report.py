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
from iprt.footage.real_material import Doubt, Evidence
from iprt.footage.sky import Sky
from iprt.footage.sun import Sun
from iprt.footage.video.picture_tracks import frame_path
from iprt.footage.video.tracks import depth_code
from iprt.geometry.equirect import solid_angles
from iprt.geometry.mesh import Instance, transformed
from iprt.scene.manifest import MANIFEST_NAME
from iprt.scene.objects import SceneObject
from iprt.scene.placement import RealSurfaces
from iprt.scene.scene import Scene


@dataclass(frozen=True)
class Share:
    """Shares of the panorama's solid angle and flux, 0 to 1."""

    area: float
    flux: float


@dataclass(frozen=True)
class ObjectReport:
    """Statistics of an object.

    They are its initial size in metres, its motion, unread contents of its file, and faults of its
    placement.
    """

    name: str
    triangles: int
    materials: tuple[str, ...]
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    moves: tuple[str, ...]
    dropped: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class RealMaterialReport:
    """Statistics of a glossy real surface.

    They are its share of the first frame, and the evidence for a surface that is not declared.
    """

    name: str
    kind: str
    alpha: float
    share: Share
    evidence: Evidence | None

    def warnings(self) -> list[str]:
        """Return the faults of its region."""
        if self.share.area > 0.0:
            return []
        return ["no texel belongs to it; check its mask, color and plane, and later entries"]


@dataclass(frozen=True)
class SkyReport:
    """A sky estimated behind windows.

    Attributes
    ----------
    factor, deviation : three floats
        `Sky.mean` and `Sky.deviation`.
    """

    factor: tuple[float, float, float]
    deviation: tuple[float, float, float]

    @classmethod
    def of(cls, sky: Sky | None) -> SkyReport | None:
        """Describe a scene's sky."""
        if sky is None:
            return None
        (r, g, b), (dr, dg, db) = (part.round(2).tolist() for part in (sky.mean, sky.deviation))
        return cls((r, g, b), (dr, dg, db))

    def line(self) -> str:
        """Return a sentence for reports."""
        factors = ", ".join(
            f"{factor:g} ± {factor * deviation:.1g}"
            for factor, deviation in zip(self.factor, self.deviation, strict=True)
        )
        return (
            f"light from above that windows do not show: {factors} times the extrapolated "
            "(r, g, b), by the room's shading"
        )


@dataclass(frozen=True)
class SunReport:
    """A sun, declared or found.

    Attributes
    ----------
    azimuth_deg, elevation_deg : float
        Its direction; azimuth 0 is -Z, and 90 is +X.
    irradiance : three floats
        As `Sun.irradiance`.
    correlation : float or None
        Evidence of a found one; None if declared.
    """

    azimuth_deg: float
    elevation_deg: float
    irradiance: tuple[float, float, float]
    correlation: float | None

    @classmethod
    def of(cls, sun: Sun | None) -> SunReport | None:
        """Describe a scene's sun."""
        if sun is None:
            return None
        x, y, z = sun.direction.tolist()
        azimuth, elevation = np.rad2deg([np.arctan2(x, -z), np.arcsin(y)]).round(1).tolist()
        return cls(azimuth, elevation, sun.irradiance, sun.correlation)

    def line(self) -> str:
        """Return a sentence for reports."""
        red, green, blue = self.irradiance
        known = "declared"
        if self.correlation is not None:
            known = f"found by its patches, with a correlation of {self.correlation:.2f}"
        return (
            f"{self.elevation_deg:.1f} degrees high, at azimuth {self.azimuth_deg:.1f}; "
            f"irradiance {red:.3g} {green:.3g} {blue:.3g}; {known}"
        )


@dataclass(frozen=True)
class SceneReport:
    """Statistics of a scene; depth percentiles in metres.

    `no_sun` tells why a sun that was looked for was not found, and `diffuse` which
    planes are not believed to be glossy.
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
    sun: SunReport | None
    sky: SkyReport | None
    no_sun: str
    diffuse: tuple[Doubt, ...]
    normals: str
    real_materials: tuple[RealMaterialReport, ...]
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
    weight = np.broadcast_to(solid_angles(frame.width, frame.height)[:, None], measured.shape)
    flux = weight * frame.radiance.mean(axis=-1)

    def share(mask: Any) -> Share:
        total = float(flux.sum())
        return Share(
            float(weight[mask].sum() / weight.sum()),
            float(flux[mask].sum()) / total if total > 0.0 else 0.0,
        )

    surfaces = RealSurfaces(frame)
    place = surroundings_of(scene, raw)
    return SceneReport(
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
        holes=share(~measured),
        openings=share(holes.opening),
        open_sky=share(holes.open_sky),
        dropouts=share(holes.dropout),
        clipped=Recovered.of(frame, scene.source.white),
        sun=SunReport.of(scene.sun),
        no_sun=scene.outside_light.doubt,
        diffuse=scene.searched_gloss.doubts if scene.manifest.video.gloss == "auto" else (),
        sky=SkyReport.of(scene.sky),
        normals="fitted to the depth" if raw.normal is None else "given",
        real_materials=tuple(
            RealMaterialReport(
                table.name,
                "mirror" if table.material.is_mirror else table.material.kind,
                table.material.alpha,
                share(frame.gloss == index + 1),
                table.evidence,
            )
            for index, table in enumerate(scene.real_materials)
        ),
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


def _describe_object(
    instance: Instance, entry: SceneObject, surfaces: RealSurfaces
) -> ObjectReport:
    mesh = instance.mesh
    vertices = transformed(instance.to_world, mesh.positions.astype(np.float64))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return ObjectReport(
        name=instance.name,
        triangles=len(mesh.triangles),
        materials=tuple("mirror" if m.is_mirror else m.kind for m in mesh.materials),
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
