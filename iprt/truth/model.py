"""Ground truth of scenes with full geometry, by Mitsuba's path tracer.

A model is a dictionary of Mitsuba scene parts (shapes, emitters) in the world of the scene format:
its capture centre is the origin. Inserted objects are parts too, added under their own names.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.truth.backend import SCALAR, mitsuba
from iprt.truth.denoise import denoise
from iprt.truth.sensor import sensor

Image = NDArray[np.float32]
Parts = Mapping[str, Any]

PATHS_AT_ONCE = 1 << 22
"""Paths per kernel launch: bounds the memory of the wavefront."""
MAX_DEPTH = 24
GUIDE_SAMPLES = 32
MOST_UNIT = 1.0 - 2.0**-24
"""The largest float32 below 1."""
MASK_SAMPLES = 64
MIRRORS = 6
"""Consecutive mirrors and smooth dielectrics that guides follow."""


def load_parts(module: str) -> Parts:
    """Return the parts of a scene, from the function `build()` of a Python module.

    The working directory is searched too.

    Raises
    ------
    IprtError
        There is no such module, or no such function in it.
    """
    sys.path.insert(0, str(Path.cwd()))
    try:
        build = import_module(module).build
    except (ImportError, AttributeError, ValueError) as error:
        raise IprtError(f"--model {module}: no such module with a build() ({error})") from None
    finally:
        sys.path.pop(0)
    parts: Parts = build()
    return parts


def load_scene(parts: Parts) -> Any:
    """Return a Mitsuba scene, ready for rays, of parts: Mitsuba dictionaries or objects by name."""
    return mitsuba().load_dict({"type": "scene", **parts})


def render_color(scene: Any, view: View, *, spp: int, seed: int, clean: bool = True) -> Image:
    """Return the radiance (H, W, 3) of a view, box-filtered, by unidirectional path tracing.

    Parameters
    ----------
    scene : Mitsuba scene
        From `load_scene`.
    spp : int
        Paths per pixel.
    seed : int
        Two renderings with one seed agree where the same surfaces and light are hit.
    clean : bool
        Denoise with albedo and normal of surfaces seen directly or in mirrors as guides.
    """
    mi = mitsuba()
    absorbs = any(shape.interior_medium() is not None for shape in scene.shapes())
    integrator = "volpathmis" if absorbs else "path"  # colors are absorbed differently
    paths = mi.load_dict({"type": integrator, "max_depth": MAX_DEPTH, "rr_depth": 5})
    color = _render(scene, sensor(view), paths, spp, seed)[..., :3]
    if not clean:
        return color
    albedo, normal = render_guides(scene, view, spp=min(spp, GUIDE_SAMPLES), seed=seed)
    return np.maximum(denoise(color, albedo, normal, wrap=view.projection == "equirect"), 0.0)


def render_guides(scene: Any, view: View, *, spp: int, seed: int) -> tuple[Image, Image]:
    """Return albedo and unit normal, (H, W, 3) each, of the first surface that is not a mirror.

    They guide a denoiser. With the mirror's own albedo and normal, it would blur reflections.
    Smooth dielectrics are passed likewise. Both are 0 where there is no surface.
    """
    guide = _render(scene, sensor(view), _guides(), spp, seed)
    return guide[..., :3], guide[..., 3:6]


def render_geometry(parts: Parts, view: View) -> tuple[Image, Image]:
    """Return radial distance (H, W), m, and unit normal (H, W, 3) along the pixel-centre rays.

    Both are 0 where the ray meets no surface. Normals face the capture centre.
    """
    layers = mitsuba().load_dict({"type": "aov", "aovs": "d:depth,n:geo_normal"})
    image = _render(load_scene(parts), sensor(view, pixel_centres=True), layers, 1, 0)
    normal = image[..., 1:4]
    facing = np.sum(normal * view.directions(), axis=-1, keepdims=True) > 0.0
    return image[..., 0], np.where(facing, -normal, normal)


def render_mask(parts: Parts, objects: Parts, view: View, *, seed: int) -> Image:
    """Return the fraction (H, W) of each pixel where one of the `objects` is the nearest surface.

    The `objects` are Mitsuba shapes, not dictionaries: they are recognised by identity.
    """
    scene = load_scene({**parts, **objects})
    return _render(scene, sensor(view), _coverage(list(objects.values())), MASK_SAMPLES, seed)[
        ..., 0
    ]


def _guides() -> Any:
    """Return an integrator with the six channels of `render_guides`."""
    mi = mitsuba()
    dr = import_module("drjit")

    class Guides(mi.SamplingIntegrator):  # type: ignore[misc, name-defined]
        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> Any:
            albedo, normal = mi.Spectrum(0.0), mi.Normal3f(0.0)
            active, ray = mi.Bool(active), mi.Ray3f(ray)
            for _ in range(MIRRORS + 1):
                hit = scene.ray_intersect(ray, active)
                active &= hit.is_valid()
                bsdf = hit.bsdf(ray)
                mirror = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection)
                glass = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaTransmission)
                last = active & ~mirror
                albedo[last] = bsdf.eval_diffuse_reflectance(hit, last)
                normal[last] = hit.sh_frame.n
                refracted, _ = bsdf.sample(
                    mi.BSDFContext(), hit, mi.Float(MOST_UNIT), mi.Point2f(0.5), glass
                )
                way = dr.select(glass, refracted.wo, mi.reflect(hit.wi))
                ray = hit.spawn_ray(hit.to_world(way))
                active = mirror
            return albedo, mi.Bool(True), [normal.x, normal.y, normal.z]

        def aov_names(self) -> list[str]:
            return ["normal.X", "normal.Y", "normal.Z"]

    return Guides(mi.Properties())


def _coverage(shapes: list[Any]) -> Any:
    """Return an integrator of radiance 1 where a primary ray meets one of `shapes` first."""
    mi = mitsuba()

    class Coverage(mi.SamplingIntegrator):  # type: ignore[misc, name-defined]
        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> Any:
            shape = scene.ray_intersect(ray, active).shape
            hit = mi.Bool(False)
            for candidate in shapes:
                hit = hit | (shape == candidate)
            return mi.Spectrum(mi.Float(hit)), mi.Bool(True), []

    return Coverage(mi.Properties())


def _render(scene: Any, camera: Any, integrator: Any, spp: int, seed: int) -> Image:
    """Return the mean of `spp` samples per pixel, in launches that fit memory."""
    mi = mitsuba()
    pixels = int(np.prod(camera.film().size()))
    per_launch = spp if mi.variant() == SCALAR else max(1, min(spp, PATHS_AT_ONCE // pixels))
    total: NDArray[np.float64] | float = 0.0
    for done in range(0, spp, per_launch):
        count = min(per_launch, spp - done)
        # Distinct seeds per launch, and far from a caller's next seed.
        image = mi.render(
            scene, sensor=camera, integrator=integrator, spp=count, seed=seed + 7919 * done
        )
        total = total + count * np.asarray(image, np.float64)
    return np.asarray(total / spp, np.float32)
