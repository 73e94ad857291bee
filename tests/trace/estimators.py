"""The tracing kernels by themselves, run by run: nothing is filtered or averaged over frames.

A furnace, where all that shines has the same radiance, has closed forms; and light sampling must
not change them, whatever table it draws directions from. So the furnaces here aim at the lamps of
another picture: estimates are noisy, and their means known.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pyopencl.array as cla
from scipy.stats import norm, t

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask, Masks
from iprt.footage.frame import Frame
from iprt.gbuffer.guide import Guide, Guides, Layer
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from iprt.settings.features import Features
from iprt.settings.filter import MaskSettings
from iprt.settings.methods import methods
from iprt.settings.model import Settings
from iprt.trace.pixels import listed_arguments
from iprt.trace.tracer_arguments import KnownArgs, SurfacesArgs
from iprt.trace.tracers import RealTracer, VirtualTracer
from iprt.world.real.camera_motion import STILL
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.real.panorama import START_BIAS
from tests.filter.gbuffer import tracing_grid
from tests.variants import variant
from tests.world.real.lighting import uploaded
from tests.worlds import Float, landscape_frame, sphere_frame

Estimator = Literal[
    "delta, aimed", "delta, even", "ratio", "em, aimed", "em, even",
    "dpt, aimed", "dpt, even", "pt-diff, aimed", "pt-diff, even", "oil, aimed",
    "dit, aimed", "dit, even", "vct, even", "dvct, even", "iprt2023",
]  # fmt: skip
Around = Literal["plain", "sphere"]
ESTIMATORS: tuple[Estimator, ...] = ("delta, aimed", "delta, even", "ratio")
PLAIN = -1.5
"""Height of the plain."""
VIEW = View(28, 20, pitch_deg=-62.0, fov_y_deg=50.0)


def furnace(around: Around) -> Frame:
    """A plain under an open sky, or the inside of a sphere: all has radiance 1."""
    if around == "sphere":
        return sphere_frame(2.0, 128, 64, 1.0)
    frame = landscape_frame(128, 64)
    return replace(frame, color=np.ones_like(frame.color))


def lamps(frame: Frame) -> Float:
    """(H, W, 3) a picture with two small lamps in a dim sky, and one on the plain."""
    d = View(frame.width, frame.height, projection="equirect").directions()
    picture = np.where(d[..., 1] > 0.0, 0.3, 0.1)
    for x, y, z, size in ((0.3, 0.8, -0.6, 0.2), (-0.7, 0.4, 0.3, 0.1), (0.1, -0.8, -0.9, 0.2)):
        towards = np.array([x, y, z]) / np.linalg.norm([x, y, z])
        picture = np.where(d @ towards > np.cos(size), 8.0, picture)
    return np.repeat(picture[..., None], 3, -1)


@dataclass
class Kernels:
    """Kernels of one scene and estimator, with the buffers that a first frame has prepared."""

    device: ComputeDevice
    renderer: Renderer
    view: cla.Array

    def _features(self, seed: int, rays: int) -> Features:
        needs = self.renderer.features
        trace = needs.settings.trace.model_copy(update={"rays": rays, "object_rays": rays})
        irradiance = needs.settings.irradiance.model_copy(update={"rays": rays})
        update = {"seed": seed, "trace": trace, "irradiance": irradiance}
        return replace(needs, settings=needs.settings.model_copy(update=update))

    def _planes(self, planes: cla.Array) -> Float:
        image = self.renderer.layout.interior(self.device.read(planes)).astype(np.float64)
        return np.ascontiguousarray(np.moveaxis(image, 0, -1))

    def receivers(self) -> tuple[Float, Float]:
        """(H, W, 3) where rays of the real pixels towards objects start, and normals there."""
        guide = self._planes(self.renderer.method.real_pixels.guide.current)
        lift = START_BIAS * self.renderer.real_world.panorama.scale
        return guide[..., 3:6] + lift * guide[..., :3], guide[..., :3]

    def change(self, seed: int, rays: int) -> Float:
        """(H, W, 3) irradiance / π that objects add to real surfaces: bounced less blocked."""
        first, second, scale = self._real(seed, rays)
        return (second - first) * scale

    def parts(self, seed: int, rays: int) -> Float:
        """(H, W, 2, 3) the same apart, of the estimator "delta": blocked, bounced."""
        first, second, scale = self._real(seed, rays)
        return np.stack([first * scale, second * scale], axis=-2)

    def ratio(self, seed: int, rays: int) -> Float:
        """(H, W, 3) irradiance with objects over that without."""
        first, second, _ = self._real(seed, rays)
        if self.renderer.real_world.irradiance is None:
            return np.asarray(second / first)
        return 1.0 + second - first

    def _real(self, seed: int, rays: int) -> tuple[Float, Float, Float]:
        renderer = self.renderer
        features = self._features(seed, rays)
        kernel, guide = renderer.method.kernels().real, renderer.method.real_pixels.guide
        trace = RealTracer(self.device, guide, features, kernel, name="run")
        trace.run(
            renderer.world,
            renderer.method.real_pixels.mask,
            self.view,
            renderer.real_world.irradiance,
            color=renderer.real.diffuse,
            min_solid_angle=0.0,
        )
        signal = self._planes(trace.signal)
        if renderer.real_world.irradiance is None:
            return signal[..., :3], signal[..., 3:], np.ones(3)
        guide = renderer.method.real_pixels.guide
        shown = self.device.zeros("shown", guide.layout.shape(3))
        renderer.real_world.irradiance.show(renderer.real_world.panorama, guide.arguments(), shown)
        return signal[..., :3], signal[..., 3:], self._planes(shown)

    def irradiance(self, seed: int, rays: int) -> Float:
        """(N, 3) E_R / π of the cells of a cache that knew nothing; each begins with 2 * rays."""
        renderer = self.renderer
        panorama, pixels = renderer.real_world.panorama, renderer.method.real_pixels
        cache = IrradianceCache(self.device, panorama, self._features(seed, rays))
        cache.place(panorama, STILL, changed=0.0, cut=False)
        cache.run(
            renderer.world.arguments(self._features(seed, rays), self.view),
            renderer.world.objects.device_bounds,
            listed_arguments(pixels.guide, pixels.mask),
            min_solid_angle=0.0,
        )
        mean = self.device.read(cache.mean).astype(np.float64)
        known = mean[:, 3] > 0.0
        assert (mean[known, 3] == 2 * rays).all()
        return np.asarray(mean[known, :3])

    @cached_property
    def _virtual(self) -> tuple[Guide, Mask, cla.Array]:
        """Pixels of virtual surfaces, all of which are traced, and a history without anything."""
        device, renderer = self.device, self.renderer
        seen, layout = renderer.visible, renderer.layout
        guide = Guide(device, layout, name="run")
        Guides(device, [guide], [Layer(seen.normal, seen.depth, seen.id)]).run(self.view)
        mask = Mask(device, guide, MaskSettings(sparse=False), name="run")
        Masks(device, [mask]).run(tracing_grid(device, (0, 0)), [seen.motion])
        return guide, mask, device.zeros("run history", layout.shape(2))

    def reflected(self, seed: int, rays: int) -> dict[str, Float]:
        """(H, W, 3) "diffuse" (without albedo) and "specular" radiance of virtual surfaces."""
        renderer = self.renderer
        guide, mask, nothing = self._virtual
        kernel, features = renderer.method.kernels().virtual, self._features(seed, rays)
        trace = VirtualTracer(self.device, guide, features, kernel)
        seen = renderer.visible
        surfaces = SurfacesArgs(
            albedo=seen.albedo,
            metallic=seen.metallic,
            roughness=seen.roughness,
            coat_normal=seen.coat_normal,
        )
        known = KnownArgs(
            certainty=nothing, specular=None, diffuse=None, mean_radiance=1.0, fading=0.0
        )
        trace.run(
            renderer.world,
            mask,
            self.view,
            surfaces,
            known,
            steady=True,
            pixel_angle=VIEW.pixel_angle,
        )
        planes = {"diffuse": trace.diffuse, "specular": trace.specular}
        return {kind: self._planes(p) for kind, p in planes.items() if p is not None}


@contextmanager
def kernels(
    device: ComputeDevice,
    frame: Frame,
    objects: list[Instance],
    estimator: Estimator = "delta, aimed",
    *,
    aim_at: Float | None = None,
    view: View = VIEW,
    own: Mapping[str, Any] | None = None,
    trace: Mapping[str, Any] | None = None,
) -> Iterator[Kernels]:
    """`aim_at`: (H, W, 3) picture whose bright parts rays are aimed at, in place of the frame's.

    `own`: settings of the estimator's method, where it has the method's name. `trace`: of its rays.
    """
    name, _, way = estimator.partition(", ")
    others: dict[str, Any] = {
        "gbuffer": "cl", "mask": {"sparse": False}, "atrous": {"levels": 0},
        "irradiance": {"rows": 64}, "iprt": {"relight_reflections": False},
        "trace": {"light_sampling": way == "aimed", "jitter": False, **(trace or {})},
    }  # fmt: skip
    if name in methods():
        chosen = Settings.model_validate(others | {"method": name, name: own or {}})
    else:
        chosen = variant(name, **others)
    with Renderer(device, frame, objects, view, chosen) as renderer:
        renderer.step()
        lights = renderer.world.lights
        assert (lights is not None) == (way == "aimed")
        if lights is not None and aim_at is not None:
            lights.load(uploaded(device, aim_at))
            assert device.read(lights.arguments().column)[-1] > 0.0
            for one in renderer.schedule.passes:
                if one.name == "lights":
                    one.run(None)
        yield Kernels(device, renderer, device.upload("run view", view.kernel_constants()))


# Tests ---------------------------------------------------------------------------------------


def confirm(samples: Float, wanted: Float, *, rounding: float = 1e-4) -> None:
    """Means of (runs, N) independent estimates are the wanted (N,), each and all together.

    Each by Student's t-test at Šidák's level, so that all N reject a right estimator once in 100
    sets of samples; their mean by a Z-test at four standard errors. Single precision and meshes may
    be off by `rounding` of the largest.
    """
    runs, count = samples.shape
    slack = rounding * np.abs(wanted).max()
    # A pixel whose runs happen to agree tells too small a deviation.
    deviation = samples.std(0, ddof=1)
    deviation = np.maximum(deviation, 0.3 * np.sqrt((deviation**2).mean()))
    threshold = t.isf(0.5 * (1.0 - 0.99 ** (1.0 / count)), runs - 1)
    apart = np.abs(samples.mean(0) - wanted)
    worst = (apart / (threshold * deviation / np.sqrt(runs) + slack)).max()
    assert worst < 1.0, f"a pixel is off by {worst:.2f} times what is allowed"
    means = samples.mean(1)
    error = means.std(ddof=1) / np.sqrt(runs)
    apart_all = means.mean() - wanted.mean()
    level = float(t.isf(norm.sf(4.0), runs - 1))
    assert abs(apart_all) < level * error + slack, f"bias {apart_all:.2e}, noise {error:.2e}"
    # The test has the power to find a bias of two percent.
    assert error < 4e-3 * np.abs(wanted.mean()), f"noise {error:.2e} of {wanted.mean():.2e}"
