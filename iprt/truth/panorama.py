"""Slow reference for the renderer: path-traced objects in the world of a panorama."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.truth.denoise import denoise
from iprt.truth.lights import instance_lights
from iprt.truth.sensor import sensor
from iprt.truth.shapes import instance_shapes

if TYPE_CHECKING:
    from iprt.truth.transport import World

Image = NDArray[np.float32]
SAMPLES_AT_ONCE = 1 << 21
RATIO_MAP_WIDTH = 512


@dataclass(frozen=True)
class Reference:
    """Differential rendering of a view (IPRT Eq. 2), and its components.

    Attributes
    ----------
    color : (H, W, 3) float32
        `ratio * background * (1 - coverage) + objects`, linear.
    background : (H, W, 3) float32
        The panorama, bilinear, averaged over each pixel's footprint.
    ratio : (H, W, 3) float32
        E_RV / E_R of the real surfaces; exactly 1 where no ray hit an object.
    objects : (H, W, 3) float32
        Radiance of the objects times their coverage.
    coverage : (H, W) float32
        Fraction of the pixel in which an object is in front of the real surfaces.
    """

    color: Image
    background: Image
    ratio: Image
    objects: Image
    coverage: Image


def load_world(frame: Frame, instances: Sequence[Instance]) -> World:
    """Return the world of a panorama, with objects in it, ready for rays.

    Raises
    ------
    IprtError
        If Mitsuba is not installed.
    DeviceError
        If Mitsuba's vectorized variant does not work.
    """
    from iprt.truth.transport import World

    return World(frame, instance_shapes(instances), instance_lights(instances))


def render_reference(
    world: World, view: View, *, spp: int, seed: int = 0, clean: bool = True
) -> Reference:
    """Path-trace the objects in the world of the panorama.

    Real surfaces are diffuse. They emit the panorama's radiance and reflect nothing further.
    Openings are surfaces that radiate and take no shadow. Rays that leave through a gap of the
    depth take the radiance of their direction. Objects see real surfaces with the objects' shadows
    and light (from a panorama-wide map of the ratio).

    Parameters
    ----------
    world : World
        From `load_world`.
    spp : int
        Samples per pixel.
    clean : bool
        Denoise objects and ratio.

    Raises
    ------
    IprtError
        If pyoidn, for denoising, is not installed.
    """
    if not world.empty:
        world.relight(None)
        width = min(RATIO_MAP_WIDTH, world.width)
        whole = View(width, width // 2, projection="equirect")
        world.relight(_render(world, whole, spp, seed + 1, clean, ratio_only=True).ratio)
    return _render(world, view, spp, seed, clean)


def _render(
    world: World, view: View, spp: int, seed: int, clean: bool, *, ratio_only: bool = False
) -> Reference:
    pixels = view.width * view.height
    per_launch = max(1, min(spp, SAMPLES_AT_ONCE // pixels))
    sums: dict[str, Any] = defaultdict(float)
    for start in range(0, spp, per_launch):
        count = min(per_launch, spp - start)
        for name, values in _launch(world, view, count, seed * 65537 + start, ratio_only).items():
            sums[name] += values
    shape = (view.height, view.width, -1)
    mean = {name: (value / spp).reshape(shape) for name, value in sums.items()}
    coverage = mean["covered"].astype(np.float32)
    real = np.maximum(1.0 - mean["covered"], 1.0 / spp)
    background = (mean["background"] / real).astype(np.float32)
    ratio = np.ones(background.shape, np.float32)
    usable = (mean["hit_object"] > 0.0) & (mean["without"] > 0.0)
    np.divide(mean["both"], mean["without"], out=ratio, where=usable, casting="unsafe")
    objects = mean["objects"].astype(np.float32)
    if clean:
        guides = [mean[name].astype(np.float32) for name in ("albedo", "normal")]
        wrap = view.projection == "equirect"
        if coverage.any():
            objects = np.where(coverage > 0.0, denoise(objects, *guides, wrap=wrap), 0.0)
        smooth = denoise(ratio, np.ones_like(ratio), guides[1], wrap=wrap)
        ratio = np.where(usable, np.maximum(smooth, 0.0), 1.0).astype(np.float32)
        objects = np.maximum(objects, 0.0).astype(np.float32)
    color = ((1.0 - coverage) * background * ratio + objects).astype(np.float32)
    return Reference(color, background, ratio, objects, coverage[..., 0])


def _launch(
    world: World, view: View, count: int, seed: int, ratio_only: bool
) -> dict[str, NDArray[np.float64]]:
    """Return sums over `count` samples of every pixel: arrays (pixels, channels)."""
    from iprt.truth.transport import dr, mi

    pixels = view.width * view.height
    samples = pixels * count
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed % 2**32, samples)
    # Opaque, so that one compiled kernel serves all counts.
    pixel = dr.arange(mi.UInt32, samples) // dr.opaque(mi.UInt32, count)
    jitter = sampler.next_2d()
    x, y = mi.Float(pixel % view.width) + jitter.x, mi.Float(pixel // view.width) + jitter.y
    place = mi.Point2f(x / view.width, y / view.height)
    ray, _ = sensor(view).sample_ray(0.0, 0.0, place, mi.Point2f(0.0))
    everywhere = dr.full(mi.Bool, True, samples)
    real = world.hit_real(ray.o, ray.d, everywhere)
    si = world.objects.ray_intersect(ray, everywhere)
    virtual = si.is_valid() & (si.t < real.t)
    if ratio_only:  # other rays see the surfaces behind the objects
        virtual &= False
    shaded = real.valid & ~virtual & world.receives(real.direction)
    normal = world.real_normal(real.direction)
    without, both, hit_object = world.irradiance(
        mi.Point3f(real.direction * real.distance), normal, sampler, shaded
    )
    zero = mi.Color3f(0.0)
    radiance = world.radiance(ray.d, relit=mi.Bool(False))
    result = {
        "background": dr.select(virtual, zero, radiance),
        "without": dr.select(shaded, without, zero),
        "both": dr.select(shaded, both, zero),
        "objects": dr.select(virtual, world.reflected(ray, si, sampler, virtual), zero),
        "covered": mi.Float(virtual),
        "hit_object": mi.Float(hit_object & shaded),
        "normal": mi.Color3f(dr.select(virtual, si.sh_frame.n, normal)),
        "albedo": dr.select(virtual, si.bsdf().eval_diffuse_reflectance(si, virtual), zero),
    }
    dr.eval(result)  # once: each sum would trace the rays again
    sums = {name: dr.block_sum(value, count) for name, value in result.items()}
    dr.eval(sums)
    return {
        name: np.asarray(value, np.float64).T.reshape(pixels, -1) for name, value in sums.items()
    }
