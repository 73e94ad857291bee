"""What a scene, a view and settings require: which passes, kernel variants and buffers exist."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from iprt.bvh.scene import STACK
from iprt.device.compute import Define
from iprt.footage.footage import Footage
from iprt.footage.window_environment import OUTSIDE_ROWS
from iprt.geometry.camera import View
from iprt.geometry.material import Material, material_defines
from iprt.settings.model import Settings

CELL = 8
"""Texels a side of the cells in which the highlight is compared with what the camera saw."""

TOUCHED_FRAMES = 10.0
"""For how long tracing remembers that an object lit or shadowed a pixel (`Mask.touched`)."""


def bvh_defines(*, textured: bool) -> dict[str, Define]:
    """`-D` variants of kernels that trace the hierarchy; `textured`: a material has a texture."""
    return {"OBJECTS_BVH": True, "BVH_STACK": STACK, "OBJECT_TEXTURES": textured}


@dataclass(frozen=True)
class Features:
    """The parts of the method that a picture needs; everything else is neither built nor stored.

    Attributes
    ----------
    objects : bool
        Something is inserted. Without, the picture is the panorama, resampled.
    tracing : bool
        Rays are traced (the method is not the distant environment).
    diffuse, conductor, mirror, plastic : bool
        Material kinds among the inserted objects.
    textured : bool
        One of them has a texture.
    deforming : bool
        Vertices of one of them move.
    equirect_view : bool
        The picture is the whole panorama.
    opening_environment : bool
        There are windows, and what lies behind them is assembled as a distant environment.
    color_map : bool
        Frames of the video may be exposed or balanced otherwise than its first.
    separate_radiance : bool
        Rays find another radiance than the picture shows: lights that were clipped, or another
        exposure.
    background : bool
        What moving things hide is remembered, and rays find it.
    real_materials : tuple of Material
        Glossy materials of the real scene that objects are reflected in; empty: all is diffuse.
    moving_camera : bool
        The video has poses: from frame to frame, real surfaces move past the capture centre.
    settings : Settings
    """

    objects: bool
    tracing: bool
    diffuse: bool
    conductor: bool
    mirror: bool
    plastic: bool
    textured: bool
    deforming: bool
    equirect_view: bool
    opening_environment: bool
    separate_radiance: bool
    color_map: bool
    background: bool
    real_materials: tuple[Material, ...]
    moving_camera: bool
    settings: Settings

    @classmethod
    def of(
        cls,
        materials: Iterable[Material],
        view: View,
        settings: Settings,
        footage: Footage,
        *,
        deforming: bool = False,
    ) -> Features:
        """`materials`: those of the objects; `deforming`: their vertices move."""
        kinds = list(materials)
        tracing = bool(kinds) and settings.method == "iprt"
        return cls(
            objects=bool(kinds),
            tracing=tracing,
            diffuse=any(m.kind == "diffuse" for m in kinds),
            conductor=any(m.kind == "conductor" and not m.is_mirror for m in kinds),
            mirror=any(m.is_mirror for m in kinds),
            plastic=any(m.kind == "plastic" for m in kinds),
            textured=any(m.texture is not None for m in kinds),
            deforming=deforming,
            equirect_view=view.projection == "equirect",
            opening_environment=tracing
            and settings.trace.openings == "environment"
            and footage.openings,
            separate_radiance=bool(kinds) and (footage.separate_radiance or footage.drifts),
            color_map=bool(kinds) and footage.drifts,
            background=tracing and settings.trace.background and footage.static_camera,
            real_materials=footage.real_materials if tracing else (),
            moving_camera=bool(kinds) and footage.poses,
            settings=settings,
        )

    @property
    def gloss(self) -> bool:
        """Real surfaces reflect objects."""
        return bool(self.real_materials)

    @property
    def diffuse_signal(self) -> bool:
        """Objects reflect diffusely."""
        return self.diffuse or self.plastic

    @property
    def specular_signal(self) -> bool:
        """Objects reflect glossily or as mirrors."""
        return self.conductor or self.mirror or self.plastic

    @property
    def jitter(self) -> bool:
        """Rays of virtual surfaces start anywhere in their pixel."""
        return self.bvh and self.settings.trace.jitter

    @property
    def delta(self) -> bool:
        """Real surfaces are relit by what objects change in a cached irradiance."""
        return self.tracing and self.settings.trace.estimator == "delta"

    @property
    def light_sampling(self) -> bool:
        """Rays are aimed at lights."""
        return self.tracing and self.settings.trace.light_sampling

    @property
    def relit_reflections(self) -> bool:
        """Objects reflect what objects do to real surfaces."""
        return self.tracing and self.settings.trace.relight_reflections

    @property
    def ratio_map(self) -> bool:
        """They do so where the view does not show these, too."""
        return self.relit_reflections and not self.equirect_view

    @property
    def bvh(self) -> bool:
        """Rays meet the objects' triangles."""
        return self.tracing and self.settings.trace.objects == "bvh"

    @property
    def primary_rays(self) -> bool:
        """What the view shows of objects is found by rays rather than by OpenGL."""
        return self.objects and self.settings.gbuffer == "cl"

    @property
    def traced_layers(self) -> bool:
        """Rays meet rasterized layers of the objects instead."""
        return self.tracing and not self.bvh

    @property
    def equirect_layers(self) -> bool:
        """Objects are rasterized in equirect space besides the screen, for rays off screen."""
        return self.traced_layers and not self.equirect_view

    def relit_defines(self) -> dict[str, Define]:
        """`-D` variants of kernels whose rays meet real surfaces relit."""
        return {"RELIT": self.relit_reflections, "RELIT_AROUND": self.ratio_map}

    def real_defines(self) -> dict[str, Define]:
        """`-D` variants of kernels whose rays meet real surfaces only: they are built alike,
        whatever the objects are made of.
        """
        return {
            "OPENING_ENVIRONMENT": self.opening_environment,
            "LIGHT_SAMPLING": self.light_sampling,
            "OUTSIDE_ROWS": OUTSIDE_ROWS,
            "BACKGROUND": self.background,
            "BASSRT": self.settings.trace.back_faces,
            **(bvh_defines(textured=False) if self.bvh else {}),
        }

    def trace_defines(self) -> dict[str, Define]:
        """`-D` variants of kernels whose rays meet objects, too."""
        return self.real_defines() | {
            "MATERIAL_DIFFUSE": self.diffuse,
            "MATERIAL_CONDUCTOR": self.conductor,
            "MATERIAL_MIRROR": self.mirror,
            "MATERIAL_PLASTIC": self.plastic,
            "HAS_DIFFUSE": self.diffuse_signal,
            "HAS_SPECULAR": self.specular_signal,
            "DISTANT_ENVIRONMENT": not self.tracing,
            "MAX_BOUNCES": self.settings.trace.bounces,
            "TOUCHED_FRAMES": TOUCHED_FRAMES,
            **(bvh_defines(textured=self.textured) if self.bvh else {}),
        }

    def highlight_defines(self) -> dict[str, Define]:
        """`-D` variants of the kernels that find what glossy real surfaces show of each other."""
        return self.real_defines() | material_defines(self.real_materials) | {"CELL": CELL}

    def gloss_defines(self) -> dict[str, Define]:
        """`-D` variants of kernels whose rays meet the materials of real surfaces too."""
        defines = self.trace_defines()
        real = material_defines(self.real_materials)
        defines |= {name: bool(defines[name]) or needed for name, needed in real.items()}
        return defines | {"GLOSS": self.gloss, "CELL": CELL if self.gloss else False}

    def describe(self) -> dict[str, bool]:
        """What is built and what is not, by name."""
        return {
            "tracing of real surfaces (shadows, bounce light)": self.tracing,
            "shading of virtual surfaces": self.objects,
            "diffuse reflection": self.diffuse_signal,
            "glossy reflection": self.conductor or self.plastic,
            "mirror reflection": self.mirror,
            "reflections in glossy real surfaces": self.gloss,
            "distant environment behind windows": self.opening_environment,
            "radiance apart from the displayed colour": self.separate_radiance,
            "drift of the video's exposure and white balance": self.color_map,
            "memory of what moving things hide": self.background,
            "irradiance cache of the panorama": self.delta,
            "aiming rays at lights": self.light_sampling,
            "shadows in what objects reflect off screen": self.ratio_map,
            "bounding volume hierarchy of the objects": self.bvh or self.primary_rays,
            "objects in the view by rays, without OpenGL": self.primary_rays,
            "motion of the 360° camera": self.moving_camera,
            "motion of every vertex": self.deforming,
            "equirect layers for rays off screen": self.equirect_layers,
        }
