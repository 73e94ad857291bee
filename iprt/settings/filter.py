"""Settings of the passes that filter sparse samples into a picture."""

from __future__ import annotations

from pydantic import Field

from iprt.settings.methods import SettingsGroup


class MaskSettings(SettingsGroup):
    """Selection of traced pixels: fewer on flat surfaces that no object lights or shadows."""

    sparse: bool = Field(
        default=True,
        description="Trace fewer rays on flat surfaces, and where a fading mean holds many "
        "samples; off: one ray per pixel.",
    )
    sigma_position: float = Field(
        default=10.0,
        ge=0.0,
        le=1e4,
        description="σ_p of Eq. 3: higher traces more pixels (1000 is nearly all of them).",
        json_schema_extra={"unit": "1/m"},
    )


class TemporalSettings(SettingsGroup):
    """Validation of a pixel's temporal history, and treatment of a short one."""

    normal_agreement: float = Field(
        default=0.9,
        ge=-1.0,
        le=1.0,
        description="Least cosine of the angle between present and past normal.",
    )
    enough: float = Field(
        default=1.5,
        ge=0.0,
        le=100.0,
        description="Diffuse light of pixels whose history has fewer effective samples is mixed "
        "with neighbours up to 28 pixels away, or 1/18 of the picture; 0: never.",
        json_schema_extra={"unit": "samples"},
    )


class AtrousSettings(SettingsGroup):
    """Reach and edge-stopping functions of the à-trous filter."""

    levels: int = Field(
        default=4,
        ge=0,
        le=5,
        description="Levels: taps reach 2^levels - 1 pixels on real surfaces, 15 at 4, twice as "
        "far on objects; 0 leaves the noise.",
        json_schema_extra={"unit": "levels"},
    )
    normal_sharpness: float = Field(
        default=24.0,
        ge=0.0,
        le=1e5,
        description="Falloff per (1 - cosine) of the normals' angle; higher keeps creases.",
    )
    deviations: float = Field(
        default=6.0,
        gt=0.0,
        le=100.0,
        description="Differences of up to this many standard deviations count as noise; lower "
        "keeps more detail and more noise.",
        json_schema_extra={"unit": "σ"},
    )
    lobe_fraction: float = Field(
        default=0.35,
        gt=0.0,
        le=4.0,
        description="Specular: fraction of the reflection lobe's half width that taps may span.",
    )
