"""Features that scene, view and settings require: they decide which passes and kernels exist."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from iprt.bvh.scene import STACK
from iprt.device.program import Define
from iprt.footage.properties import Footage
from iprt.footage.window_environment import OUTSIDE_ROWS
from iprt.geometry.camera import View
from iprt.geometry.material import DIFFUSE_KINDS, SPECULAR_KINDS, Material
from iprt.settings.methods import Needs, method
from iprt.settings.model import Settings

CELL = 8
"""Texels a side of the cells in which the highlight is compared with what the camera saw."""

TOUCHED_FRAMES = 11.0
"""For how many frames, the one of tracing among them, it is remembered that an object lit or
shadowed a pixel (`Mask.touched`)."""


BVH_DEFINES: Mapping[str, Define] = MappingProxyType({"OBJECTS_BVH": True, "BVH_STACK": STACK})
"""`-D` variants of kernels that trace the hierarchy."""


@dataclass(frozen=True)
class Features:
    """The parts of the method that a picture needs; everything else is neither built nor stored.

    Attributes
    ----------
    objects : bool
        Something is inserted. Without, the picture is the panorama, resampled.
    tracing : bool
        Rays are traced.
    kinds : frozenset of str
        Kinds of reflectance of the inserted objects; a conductor without roughness is a "mirror".
    deforming : bool
        Vertices of one of them move.
    equirect_view : bool
        The picture is the whole panorama.
    opening_environment : bool
        There are windows, and what lies behind them is assembled as a distant environment.
    clipped : bool
        The picture shows some lights otherwise than rays find them: they were clipped.
    color_map : bool
        Frames of the video may be exposed or balanced otherwise than its first.
    video : bool
        There are several frames.
    background : bool
        What moving things hide is remembered, and rays find it.
    learned_hidden : bool
        Rays find surfaces that the frame hides, as far as the video's frames have shown them.
    real_materials : tuple of Material
        Glossy materials of the real scene that objects are reflected in; empty: all is diffuse.
    moving_camera : bool
        The video has poses: from frame to frame, real surfaces move past the capture centre.
    needs : Needs
        What the method asks for.
    settings : Settings
    """

    objects: bool
    tracing: bool
    kinds: frozenset[str]
    deforming: bool
    equirect_view: bool
    opening_environment: bool
    clipped: bool
    color_map: bool
    video: bool
    background: bool
    learned_hidden: bool
    real_materials: tuple[Material, ...]
    moving_camera: bool
    needs: Needs
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
        kinds = frozenset("mirror" if m.is_mirror else m.kind for m in materials)
        needs = method(settings.method).needs(settings)
        tracing = bool(kinds) and needs.tracing
        return cls(
            objects=bool(kinds),
            tracing=tracing,
            kinds=kinds,
            deforming=deforming,
            equirect_view=view.projection == "equirect",
            opening_environment=tracing
            and not needs.impostor
            and settings.trace.openings == "environment"
            and footage.openings,
            clipped=footage.clips,
            color_map=bool(kinds) and footage.drifts,
            video=footage.video,
            background=tracing
            and not (needs.distant or needs.impostor)
            and settings.trace.background
            and footage.static_camera,
            learned_hidden=tracing
            and not (needs.distant or needs.impostor)
            and settings.trace.learned,
            real_materials=footage.real_materials if tracing and needs.gloss else (),
            moving_camera=bool(kinds) and footage.poses,
            needs=needs,
            settings=settings,
        )

    @property
    def gloss(self) -> bool:
        """Real surfaces reflect objects."""
        return bool(self.real_materials)

    @property
    def diffuse_signal(self) -> bool:
        """Objects reflect diffusely."""
        return bool(self.kinds & DIFFUSE_KINDS)

    @property
    def specular_signal(self) -> bool:
        """Objects reflect glossily or as mirrors."""
        return bool(self.kinds & SPECULAR_KINDS)

    @property
    def relit(self) -> bool:
        """Objects shadow and light real surfaces."""
        return self.objects and self.needs.relit

    @property
    def jitter(self) -> bool:
        """Rays of virtual surfaces start anywhere in their pixel."""
        return self.bvh and self.settings.trace.jitter

    @property
    def delta(self) -> bool:
        """Real surfaces are relit by what objects change in a cached irradiance."""
        return self.tracing and self.needs.irradiance

    @property
    def light_sampling(self) -> bool:
        """Rays are aimed at lights."""
        return self.tracing and self.settings.trace.light_sampling

    @property
    def learning(self) -> bool:
        """The radiance of real surfaces is learned from the video."""
        return self.learned_hidden or (self.tracing and self.needs.learned)

    @property
    def impostor(self) -> bool:
        """Rays see a distance impostor around the objects."""
        return self.tracing and self.needs.impostor

    @property
    def relit_reflections(self) -> bool:
        """Objects reflect what objects do to real surfaces."""
        return self.tracing and self.needs.relit_reflections

    @property
    def ratio_map(self) -> bool:
        """They do so where the view does not show these, too."""
        return self.relit_reflections and self.needs.ratio_rows > 0 and not self.equirect_view

    @property
    def bvh(self) -> bool:
        """Rays meet the objects' triangles."""
        return self.tracing and self.needs.objects == "triangles"

    @property
    def primary_rays(self) -> bool:
        """Primary rays find the objects in the view, if OpenGL does not do it faster.

        OpenGL draws the layers that rays meet, and by default the view with them.
        """
        chosen = self.settings.gbuffer
        return self.objects and (chosen == "cl" or (chosen == "auto" and not self.traced_layers))

    @property
    def traced_layers(self) -> bool:
        """Rays meet rasterized layers of the objects instead."""
        return self.tracing and not self.bvh

    @property
    def equirect_layers(self) -> bool:
        """Objects are rasterized in equirect space besides the screen, for rays off screen."""
        return self.traced_layers and not self.equirect_view

    @property
    def of_real_world(self) -> tuple[Hashable, ...]:
        """All that the real world on a device depends on: views with equal ones can share it."""
        settings, trace = self.settings, self.settings.trace
        return (
            self.objects,
            self.opening_environment,
            self.color_map,
            self.video,
            self.background,
            self.learning,
            self.real_materials,
            self.moving_camera,
            self.delta,
            tuple(self.real_defines().items()),
            self.light_sampling,
            (trace.thickness, trace.thickness_ratio, trace.back_faces),
            (settings.gloss, settings.irradiance, settings.learning),
            (settings.seed, settings.check_kernels),
        )

    def real_defines(self) -> dict[str, Define]:
        """Return `-D` variants of kernels whose rays meet real surfaces."""
        return {
            "OUTSIDE_ROWS": OUTSIDE_ROWS,
            "BACKGROUND": self.background,
            "LEARNED_HIDDEN": self.learned_hidden,
            **(BVH_DEFINES if self.bvh else {}),
        }

    def trace_defines(self) -> dict[str, Define]:
        """Return `-D` variants of kernels whose rays meet objects, too."""
        return self.real_defines() | {
            "DISTANT_ENVIRONMENT": self.needs.distant or not self.tracing,
            "IMPOSTOR": self.impostor,
            "TOUCHED_FRAMES": TOUCHED_FRAMES,
        }

    def highlight_defines(self) -> dict[str, Define]:
        """Return `-D` variants of the kernels that find the highlights of real surfaces."""
        return self.real_defines() | {"CELL": CELL}

    def gloss_defines(self) -> dict[str, Define]:
        """Return `-D` variants of kernels whose rays meet glossy real surfaces too."""
        return self.trace_defines() | {"GLOSS": self.gloss, "CELL": CELL}

    def describe(self) -> dict[str, bool]:
        """Features by name, and whether they are built."""
        return {
            "relighting of real surfaces (shadows, bounce light)": self.relit,
            "shading of virtual surfaces": self.objects,
            "diffuse reflection": self.diffuse_signal,
            "glossy reflection": bool(self.kinds & {"conductor", "plastic"}),
            "mirror reflection": "mirror" in self.kinds,
            "reflections in glossy real surfaces": self.gloss,
            "distant environment behind windows": self.opening_environment,
            "drift of the video's exposure and white balance": self.color_map,
            "memory of what moving things hide": self.background,
            "learned radiance of real surfaces": self.learning,
            "irradiance cache of the panorama": self.delta,
            "aiming rays at lights": self.light_sampling,
            "distance impostor around the objects": self.impostor,
            "shadows in what objects reflect off screen": self.ratio_map,
            "bounding volume hierarchy of the objects": self.bvh or self.primary_rays,
            "objects in the view by rays, without OpenGL": self.primary_rays,
            "motion of the 360° camera": self.moving_camera,
            "motion of every vertex": self.deforming,
            "equirect layers for rays off screen": self.equirect_layers,
        }
