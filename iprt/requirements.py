"""What a scene, a view and settings require: which passes, kernel variants and buffers exist."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from iprt.device.compute import Define
from iprt.passes.mask import TOUCHED_FRAMES
from iprt.scene.camera import View
from iprt.scene.material import Material
from iprt.scene.outside import OUTSIDE_ROWS
from iprt.settings import Settings


@dataclass(frozen=True)
class Requirements:
    """The parts of the method that a picture needs; everything else is neither built nor stored.

    Attributes
    ----------
    objects : bool
        Something is inserted. Without, the picture is the panorama, resampled.
    tracing : bool
        Rays are traced (the method is not the distant environment).
    diffuse, conductor, mirror, plastic : bool
        Material kinds among the inserted objects.
    equirect_view : bool
        The picture is the whole panorama.
    opening_environment : bool
        There are windows, and what lies behind them is assembled as a distant environment.
    settings : Settings
    """

    objects: bool
    tracing: bool
    diffuse: bool
    conductor: bool
    mirror: bool
    plastic: bool
    equirect_view: bool
    opening_environment: bool
    settings: Settings

    @classmethod
    def of(
        cls,
        materials: Iterable[Material],
        view: View,
        settings: Settings,
        *,
        openings: bool,
    ) -> Requirements:
        """`openings`: the video frame has windows."""
        kinds = list(materials)
        tracing = bool(kinds) and settings.method == "iprt"
        return cls(
            objects=bool(kinds),
            tracing=tracing,
            diffuse=any(m.kind == "diffuse" for m in kinds),
            conductor=any(m.kind == "conductor" and not m.is_mirror for m in kinds),
            mirror=any(m.is_mirror for m in kinds),
            plastic=any(m.kind == "plastic" for m in kinds),
            equirect_view=view.projection == "equirect",
            opening_environment=tracing and settings.trace.openings == "environment" and openings,
            settings=settings,
        )

    @property
    def diffuse_signal(self) -> bool:
        """Objects reflect diffusely."""
        return self.diffuse or self.plastic

    @property
    def specular_signal(self) -> bool:
        """Objects reflect glossily or as mirrors."""
        return self.conductor or self.mirror or self.plastic

    @property
    def equirect_layers(self) -> bool:
        """Objects are rasterized in equirect space besides the screen, for rays off screen."""
        return self.tracing and not self.equirect_view

    def trace_defines(self) -> dict[str, Define]:
        """`-D` variants of the tracing kernels."""
        return {
            "MATERIAL_DIFFUSE": self.diffuse,
            "MATERIAL_CONDUCTOR": self.conductor,
            "MATERIAL_MIRROR": self.mirror,
            "MATERIAL_PLASTIC": self.plastic,
            "HAS_DIFFUSE": self.diffuse_signal,
            "HAS_SPECULAR": self.specular_signal,
            "DISTANT_ENVIRONMENT": not self.tracing,
            "OPENING_ENVIRONMENT": self.opening_environment,
            "OUTSIDE_ROWS": OUTSIDE_ROWS,
            "BASSRT": self.settings.trace.back_faces,
            "MAX_BOUNCES": self.settings.trace.bounces,
            "TOUCHED_FRAMES": TOUCHED_FRAMES,
        }

    def describe(self) -> dict[str, bool]:
        """What is built and what is not, by name."""
        return {
            "tracing of real surfaces (shadows, bounce light)": self.tracing,
            "shading of virtual surfaces": self.objects,
            "diffuse reflection": self.diffuse_signal,
            "glossy reflection": self.conductor or self.plastic,
            "mirror reflection": self.mirror,
            "distant environment behind windows": self.opening_environment,
            "equirect layers for rays off screen": self.equirect_layers,
        }
