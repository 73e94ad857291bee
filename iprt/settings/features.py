"""Features that scene, view and settings require; they select the passes and kernels."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from iprt.bvh.scene import STACK
from iprt.device.kernel_source import float_constant
from iprt.device.program import Define
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Lobe, Material
from iprt.geometry.material_needs import MaterialNeeds
from iprt.settings.methods import Needs, method
from iprt.settings.model import Settings

TOUCHED_FRAMES = float_constant("lib/gbuffer/guide.h", "TOUCHED_FRAMES")
"""Number of frames, the traced one included, for which a pixel counts as touched by an object's
light or shadow (`Mask.touched`)."""


BVH_DEFINES: Mapping[str, Define] = MappingProxyType({"OBJECTS_BVH": True, "BVH_STACK": STACK})
"""`-D` defines of kernels that trace the hierarchy."""


@dataclass(frozen=True)
class Features:
    """The parts of the method that a picture needs; nothing else is built or stored.

    Attributes
    ----------
    objects : bool
        There are virtual objects. Without any, the picture is the resampled panorama.
    tracing : bool
        Rays are traced.
    lobes : frozenset of str
        Lobes of the objects' reflectance (`Material.lobes`).
    materials : MaterialNeeds
        Needs of the objects' materials.
    virtual_lights : bool
        Lights without geometry shine.
    lamp_tree : bool
        Rays choose among many emitting triangles by a tree.
    deforming : bool
        Some object's mesh deforms.
    equirect_view : bool
        The picture is the whole panorama.
    opening_environment : bool
        The scene has windows, and a distant environment is assembled behind them.
    clipped : bool
        Lights are clipped, so that the picture shows them darker than rays find them.
    color_map : bool
        Exposure or white balance may differ between frames of the video.
    video : bool
        There are several frames.
    background : bool
        Surfaces hidden by moving things are remembered, and rays find them.
    real_materials : tuple of Material
        Glossy materials of the real scene that reflect objects; empty if all is diffuse.
    moving_camera : bool
        The video has poses: real surfaces move relative to the capture centre.
    sun : bool
        A sun shines that the panorama need not show.
    needs : Needs
        Requirements of the method.
    settings : Settings
    """

    objects: bool
    tracing: bool
    lobes: frozenset[Lobe]
    materials: MaterialNeeds
    virtual_lights: bool
    lamp_tree: bool
    deforming: bool
    equirect_view: bool
    opening_environment: bool
    clipped: bool
    color_map: bool
    video: bool
    background: bool
    real_materials: tuple[Material, ...]
    moving_camera: bool
    sun: bool
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
        lights: bool = False,
        many_lamps: bool = False,
        deforming: bool = False,
    ) -> Features:
        """Derive the features of a picture.

        Parameters
        ----------
        materials : iterable of Material
            Materials of the objects.
        view : View
        settings : Settings
        footage : Footage
        lights : bool
            Some object is a light without geometry.
        many_lamps : bool
            More triangles emit light than are chosen by power alone.
        deforming : bool
            Some object's mesh deforms.
        """
        materials = list(materials)
        needs = method(settings.method).needs(settings)
        virtual_lights = lights and needs.lights
        objects = bool(materials) or virtual_lights
        tracing = objects and needs.tracing
        return cls(
            objects=objects,
            tracing=tracing,
            lobes=frozenset().union(*(material.lobes for material in materials)),
            materials=MaterialNeeds.of(materials),
            virtual_lights=virtual_lights,
            lamp_tree=many_lamps and tracing and needs.objects == "triangles",
            deforming=deforming,
            equirect_view=view.projection == "equirect",
            opening_environment=tracing
            and not needs.impostor
            and settings.trace.openings == "environment"
            and footage.openings,
            clipped=footage.clips,
            color_map=objects and footage.drifts,
            video=footage.video,
            background=tracing
            and not (needs.distant or needs.impostor)
            and settings.trace.background
            and footage.static_camera,
            real_materials=footage.real_materials if tracing and needs.gloss else (),
            moving_camera=objects and footage.poses,
            sun=tracing and needs.sun and settings.trace.light_sampling and footage.sun,
            needs=needs,
            settings=settings,
        )

    @property
    def gloss(self) -> bool:
        """True if real surfaces reflect objects."""
        return bool(self.real_materials)

    @property
    def diffuse_signal(self) -> bool:
        """True if objects have a diffuse lobe; lights alone have one, because passes need it."""
        return "diffuse" in self.lobes or (self.virtual_lights and not self.lobes)

    @property
    def specular_signal(self) -> bool:
        """True if objects have a specular lobe, glossy or mirror."""
        return bool(self.lobes - {"diffuse"})

    @property
    def relit(self) -> bool:
        """True if objects shadow and light real surfaces."""
        return self.objects and self.needs.relit

    @property
    def added_light(self) -> bool:
        """True if objects emit light."""
        return self.materials.emission or self.virtual_lights

    @property
    def jitter(self) -> bool:
        """True if rays of virtual surfaces start at jittered positions in their pixel."""
        return self.bvh and self.settings.trace.jitter

    @property
    def delta(self) -> bool:
        """True if real surfaces are relit by the objects' change of a cached irradiance."""
        return self.tracing and self.needs.irradiance

    @property
    def sleeping(self) -> bool:
        """True if tiles of real surfaces sleep on which objects have no visible influence."""
        return self.delta and self.settings.fading > 0.0 and not self.needs.published_filter

    @property
    def light_sampling(self) -> bool:
        """True if rays sample the lights."""
        return self.tracing and self.settings.trace.light_sampling

    @property
    def impostor(self) -> bool:
        """True if rays meet a distance impostor around the objects."""
        return self.tracing and self.needs.impostor

    @property
    def relit_reflections(self) -> bool:
        """True if objects reflect relit real surfaces."""
        return self.tracing and self.needs.relit_reflections

    @property
    def ratio_map(self) -> bool:
        """True if objects also reflect relit real surfaces outside the view."""
        return self.relit_reflections and self.needs.ratio_rows > 0 and not self.equirect_view

    @property
    def bvh(self) -> bool:
        """True if rays meet the objects' triangles."""
        return self.tracing and self.needs.objects == "triangles"

    @property
    def refracts(self) -> bool:
        """True if rays pass through dielectrics."""
        return self.bvh and self.materials.glass

    @property
    def primary_rays(self) -> bool:
        """True if primary rays find the objects in the view, instead of OpenGL.

        OpenGL always draws the layers for layer tracing, and then by default also the view.
        """
        chosen = self.settings.gbuffer
        return self.objects and (chosen == "cl" or (chosen == "auto" and not self.traced_layers))

    @property
    def traced_layers(self) -> bool:
        """True if rays meet rasterized layers of the objects instead of triangles."""
        return self.tracing and not self.bvh

    @property
    def equirect_layers(self) -> bool:
        """True if objects are also rasterized in equirect space, for rays off screen."""
        return self.traced_layers and not self.equirect_view

    @property
    def of_real_world(self) -> tuple[Hashable, ...]:
        """Key of the real world on a device; views with equal keys can share it."""
        settings, trace = self.settings, self.settings.trace
        return (
            self.objects,
            self.opening_environment,
            self.color_map,
            self.video,
            self.background,
            self.real_materials,
            self.moving_camera,
            self.delta,
            tuple(self.real_defines().items()),
            self.light_sampling,
            (trace.thickness, trace.thickness_ratio, trace.back_faces),
            (settings.gloss, settings.irradiance),
            settings.seed,
        )

    def real_defines(self) -> dict[str, Define]:
        """Return `-D` defines of kernels whose rays meet real surfaces."""
        return {
            "BACKGROUND": self.background,
            **(BVH_DEFINES if self.bvh else {}),
        }

    def trace_defines(self) -> dict[str, Define]:
        """Return `-D` defines of kernels whose rays also meet objects."""
        return self.real_defines() | {
            "DISTANT_ENVIRONMENT": self.needs.distant or not self.tracing,
            "IMPOSTOR": self.impostor,
            "SUN": self.sun,
            "ADDED_LIGHT": self.added_light,
            "VIRTUAL_LIGHTS": self.virtual_lights,
            "LAMP_TREE": self.lamp_tree,
            **self.materials.defines(),
        }

    def gloss_defines(self) -> dict[str, Define]:
        """Return `-D` defines of kernels whose rays also meet glossy real surfaces."""
        return self.trace_defines() | {"GLOSS": self.gloss}

    def describe(self) -> dict[str, bool]:
        """Return all features by name, with True for the ones that are built."""
        return {
            "relighting of real surfaces (shadows, bounce light)": self.relit,
            "shading of virtual surfaces": self.objects,
            "diffuse reflection": self.diffuse_signal,
            "glossy reflection": "glossy" in self.lobes,
            "mirror reflection": "mirror" in self.lobes,
            "reflections in glossy real surfaces": self.gloss,
            "distant environment behind windows": self.opening_environment,
            "drift of the video's exposure and white balance": self.color_map,
            "memory of surfaces that moving things hide": self.background,
            "irradiance cache of the panorama": self.delta,
            "aiming rays at lights": self.light_sampling,
            "sun that the panorama does not show": self.sun,
            "lights without geometry": self.virtual_lights,
            "tree of emitting triangles": self.lamp_tree,
            "distance impostor around the objects": self.impostor,
            "shadows in reflections of off-screen surfaces": self.ratio_map,
            "bounding volume hierarchy of the objects": self.bvh or self.primary_rays,
            "objects in the view by rays, without OpenGL": self.primary_rays,
            "motion of the 360° camera": self.moving_camera,
            "motion of every vertex": self.deforming,
            "equirect layers for rays off screen": self.equirect_layers,
        }
