"""Light and reflections of a scene, in the words of `iprt scene info` and of the viewers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.footage.real_material import Doubt, Evidence
from iprt.footage.sky import Sky
from iprt.footage.sun import Sun
from iprt.geometry.equirect import solid_angles
from iprt.scene.light_edits import angles_of
from iprt.scene.scene import Scene


@dataclass(frozen=True)
class Share:
    """Shares of the panorama's solid angle and flux, 0 to 1."""

    area: float
    flux: float

    def line(self) -> str:
        """Return the shares as text."""
        return f"{100 * self.area:.2f}% of all directions, {100 * self.flux:.1f}% of all light"


@dataclass(frozen=True, eq=False)
class Shares:
    """Weights of texels, for the shares of regions.

    Attributes
    ----------
    area, flux : (H, W)
        Solid angle, and radiance times solid angle.
    """

    area: NDArray[Any]
    flux: NDArray[Any]

    @classmethod
    def of(cls, frame: Frame) -> Self:
        """Return the weights of a frame's texels."""
        angles = solid_angles(frame.width, frame.height)[:, None]
        area = np.broadcast_to(angles, frame.depth.shape)
        return cls(area, area * frame.radiance.mean(axis=-1))

    def within(self, mask: NDArray[np.bool_]) -> Share:
        """Return the share of the texels in a mask (H, W)."""
        total = float(self.flux.sum())
        return Share(
            float(self.area[mask].sum() / self.area.sum()),
            float(self.flux[mask].sum()) / total if total > 0.0 else 0.0,
        )


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

    def line(self) -> str:
        """Return a sentence for reports."""
        warned = "".join(f"; warning: {phrase}" for phrase in self.warnings())
        found = f"; {self.evidence.line()}" if self.evidence is not None else ""
        return f"{self.name}: {self.kind}, alpha {self.alpha:g}; {self.share.line()}{found}{warned}"


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
        azimuth, elevation = angles_of(sun.direction.tolist())
        return cls(round(azimuth, 1), round(elevation, 1), sun.irradiance, sun.correlation)

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
class LightReport:
    """The light from outside that no camera saw, and glossy real surfaces.

    `no_sun` tells why a sun that was looked for was not found, and `diffuse` which planes are not
    believed to be glossy.
    """

    sun: SunReport | None
    no_sun: str
    sky: SkyReport | None
    real_materials: tuple[RealMaterialReport, ...]
    diffuse: tuple[Doubt, ...]

    def lines(self) -> list[tuple[str, str]]:
        """Return labels and sentences."""
        lines = [] if self.sun is None else [("sun", self.sun.line())]
        lines += [("no sun", self.no_sun)] if self.no_sun else []
        lines += [] if self.sky is None else [("sky", self.sky.line())]
        lines += [("glossy", entry.line()) for entry in self.real_materials]
        return lines + [("diffuse", doubt.line()) for doubt in self.diffuse]


def describe_light(scene: Scene, frame: Frame, shares: Shares) -> LightReport:
    """Describe the light and the reflections of a scene.

    Parameters
    ----------
    frame : Frame
        The first frame.
    shares : Shares
        Its weights.
    """
    gloss = np.zeros(frame.depth.shape, np.uint8) if frame.gloss is None else frame.gloss
    return LightReport(
        sun=SunReport.of(scene.sun),
        no_sun=scene.outside_light.doubt,
        sky=SkyReport.of(scene.sky),
        real_materials=tuple(
            RealMaterialReport(
                table.name,
                "mirror" if table.material.is_mirror else table.material.kind,
                table.material.alpha,
                shares.within(gloss == index + 1),
                table.evidence,
            )
            for index, table in enumerate(scene.real_materials)
        ),
        diffuse=scene.searched_gloss.doubts if scene.manifest.video.gloss == "auto" else (),
    )
