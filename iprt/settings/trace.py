"""Settings of ray tracing, and of the caches of the real world that rays use."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from iprt.settings.methods import SettingsGroup


class TraceSettings(SettingsGroup):
    """Ray counts, path length, and assumptions about the hidden parts of the scene."""

    light_sampling: bool = Field(
        default=True,
        description="Aim rays at the bright parts of the panorama too; off: by reflectance only.",
    )
    rays: int = Field(
        default=1,
        ge=1,
        le=1024,
        description="Rays per traced pixel of real surfaces and frame; noise ∝ 1/√rays.",
        json_schema_extra={"unit": "rays"},
    )
    object_rays: int = Field(
        default=8,
        ge=1,
        le=1024,
        description="Rays per traced pixel of objects in its first frames. Later a quarter in "
        "still pictures; in motion one ray to twice the number, by noise. Up to four times as many "
        "at edges.",
        json_schema_extra={"unit": "rays"},
    )
    bounces: int = Field(
        default=4,
        ge=1,
        le=16,
        description="Virtual surfaces that a path may meet before it meets real ones only.",
    )
    thickness: float = Field(
        default=0.05,
        ge=0.0,
        le=10.0,
        description="Least thickness of real surfaces, in a room (median depth 2 m).",
        json_schema_extra={"unit": "m"},
    )
    thickness_ratio: float = Field(
        default=0.05,
        ge=0.0,
        le=1.0,
        description="Least thickness of real surfaces as a fraction of their distance.",
    )
    back_faces: bool = Field(
        default=True, description="Substitute back faces that the camera never saw (BASSRT)."
    )
    background: bool = Field(
        default=True,
        description="Remember surfaces that moving things hide in the video of a static camera, "
        "for rays that pass behind these.",
    )
    caustic_clamp: float = Field(
        default=4.0,
        ge=1.0,
        le=1e4,
        description="Largest factor by which objects brighten a real surface by reflected and "
        "refracted light: higher keeps caustics, lower cuts specks. Lamps have no such limit.",
    )
    openings: Literal["environment", "surface"] = Field(
        default="environment",
        description="Radiance of windows: a distant environment behind them, or their own pixels.",
    )
    jitter: bool = Field(
        default=True,
        description="Shade objects at points all over each pixel, metals only while nothing moves, "
        "which smooths reflections; where rays meet triangles.",
    )


class GlossSettings(SettingsGroup):
    """Reflections in glossy real surfaces, which a scene declares (`[[real_materials]]`)."""

    rays: int = Field(
        default=2,
        ge=1,
        le=4096,
        description="Rays per sampled texel of glossy surfaces that estimate the highlight to "
        "remove.",
        json_schema_extra={"unit": "rays"},
    )


class LearningSettings(SettingsGroup):
    """Learning of the real surfaces' radiance from the video, for methods that use it."""

    samples: int = Field(
        default=16384,
        ge=64,
        le=2**20,
        description="Samples of the panorama per learned frame, until a frame of the video has "
        "given as many as it has texels.",
    )
    models: int = Field(
        default=32768,
        ge=64,
        le=2**20,
        description="Largest number of linear models, of 104 bytes each and their entries in "
        "the grid.",
    )
    search_radius: float = Field(
        default=0.2,
        gt=0.0,
        le=10.0,
        description="Search radius: largest reach of a model, in a room.",
        json_schema_extra={"unit": "m"},
    )
    forgetting: float = Field(
        default=0.999,
        ge=0.9,
        le=1.0,
        description="Factor of a sample's weight for each later sample, in the limit.",
    )


class IrradianceSettings(SettingsGroup):
    """Resolution and sampling of E_R, the irradiance of the real surfaces."""

    rows: int = Field(
        default=128,
        ge=16,
        le=2048,
        description="Rows of the grid around the capture centre; it has twice as many columns.",
        json_schema_extra={"unit": "rows"},
    )
    rays: int = Field(
        default=16,
        ge=1,
        le=1024,
        description="Rays per cell and frame, where objects have influence; twice as many when "
        "a cell is first needed.",
        json_schema_extra={"unit": "rays"},
    )
    samples: int = Field(
        default=256,
        ge=1,
        le=2**20,
        description="Rays after which a cell is not refined further; noise of E_R ∝ 1/√samples.",
        json_schema_extra={"unit": "rays"},
    )
