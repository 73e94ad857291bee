"""Light transport in the world of a panorama, by brute force with Mitsuba's ray casting.

The model is the renderer's, implemented independently. Real surfaces are a triangle mesh that emits
the panorama's radiance and reflects nothing further. Virtual objects are Mitsuba shapes with
Mitsuba BSDFs. Importing this module starts Mitsuba.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.footage.depth_mesh import depth_mesh
from iprt.footage.frame import LUMINANCE, Frame
from iprt.footage.sun import Sun
from iprt.geometry.equirect import solid_angles
from iprt.truth.backend import vector_mitsuba

mi: Any = vector_mitsuba()
dr: Any = import_module("drjit")

BOUNCES = 6
"""Most opaque virtual surfaces on a path."""
SURFACES = 64
"""Most virtual surfaces on a path; rough glass reflects light inside often."""
LIFT = 1e-3
"""Offset of rays above real surfaces, in units of the panorama's median depth."""


@dataclass(frozen=True)
class SunDisc:
    """A sun, with the same radiance everywhere on its disc.

    Attributes
    ----------
    frame : Frame3f
        Its normal is the direction towards the sun.
    cosine : float
        Cosine of the disc's radius.
    irradiance : Color3f
        Of a surface perpendicular to it.
    """

    frame: Any
    cosine: float
    irradiance: Any

    @classmethod
    def of(cls, sun: Sun, pose: NDArray[np.float64] | None) -> SunDisc:
        """Return the sun in the axes of a capture centre with this pose."""
        frame = mi.Frame3f(mi.Vector3f(*sun.seen_from(pose).tolist()))
        return cls(frame, (1.0 - sun.sine_squared) ** 0.5, mi.Color3f(*sun.irradiance))

    def sample(self, sampler: Any, active: Any) -> Any:
        """Return directions, uniform over the disc."""
        return self.frame.to_world(
            mi.warp.square_to_uniform_cone(sampler.next_2d(active), self.cosine)
        )

    def radiance(self, direction: Any) -> Any:
        """Return the radiance in a direction."""
        inside = dr.dot(direction, self.frame.n) > self.cosine
        return dr.select(inside, self.irradiance / (2.0 * dr.pi * (1.0 - self.cosine)), 0.0)


@dataclass
class RealHit:
    """Hits of rays with the real scene; arrays over rays.

    Attributes
    ----------
    valid : Bool
        A surface is hit; otherwise the ray leaves the scene.
    t : Float
        Metres; infinite where none is hit.
    direction : Vector3f
        From the capture centre to the hit point, or the ray's own.
    cosine_centre, distance : Float
        At that point, |cosine| of `direction` to the surface, and metres to the centre.
    cosine_ray : Float
        |cosine| of the ray to the surface.
    """

    valid: Any
    t: Any
    direction: Any
    cosine_centre: Any
    distance: Any
    cosine_ray: Any


class World:
    """Frame, objects and lights, which are Mitsuba shapes and emitters by name, ready for rays.

    `empty` tells that there are no objects and no lights.
    """

    def __init__(self, frame: Frame, shapes: dict[str, Any], lights: dict[str, Any]) -> None:
        self.scale = frame.median_depth
        self.width, self.height = frame.width, frame.height
        mesh = depth_mesh(frame)
        self.real = mi.load_dict(
            {"type": "scene", "surface": _shape(mesh.positions, mesh.triangles)}
        )
        self.empty = not (shapes or lights)
        self._lights = mi.load_dict({"type": "scene", **lights}) if lights else None
        self._absorbs = any(shape.interior_medium() is not None for shape in shapes.values())
        self.objects = mi.load_dict({"type": "scene", **shapes})
        self._color = _texture(frame.radiance)
        self._normal = _texture(frame.fitted_normal)
        receives = np.isfinite(frame.depth) & ~frame.opening
        self._receives = _texture(receives[..., None].astype(np.float32), nearest=True)
        self.relight(None)
        weight = frame.radiance.astype(np.float64) @ LUMINANCE
        weight = (weight + 0.05 * weight.mean() + 1e-30) * solid_angles(self.width, self.height)[
            :, None
        ]
        self._texels = mi.DiscreteDistribution(mi.Float(weight.ravel().astype(np.float32)))
        self._sun = None if frame.sun is None else SunDisc.of(frame.sun, frame.pose)

    def relight(self, ratio: NDArray[np.float32] | None) -> None:
        """Multiply real radiance, as seen by objects, by `ratio` (h, w, 3); None: by 1."""
        self._ratio = _texture(np.ones((2, 4, 3), np.float32) if ratio is None else ratio)

    def radiance(self, direction: Any, *, relit: Any) -> Any:
        """Return the panorama's radiance, changed by objects where `relit`."""
        uv = _equirect_uv(direction)
        radiance = _lookup(self._color, uv)
        return dr.select(relit, radiance * _lookup(self._ratio, uv), radiance)

    def receives(self, direction: Any) -> Any:
        """Return whether objects cast shadows in a direction: on surfaces other than openings."""
        return _lookup(self._receives, _equirect_uv(direction), 1).x > 0.5

    def real_normal(self, direction: Any) -> Any:
        """Return the panorama's unit normal in a direction, facing the capture centre."""
        normal = dr.normalize(mi.Vector3f(_lookup(self._normal, _equirect_uv(direction))))
        return dr.select(dr.dot(normal, direction) > 0.0, -normal, normal)

    def hit_real(self, origin: Any, direction: Any, active: Any) -> RealHit:
        """Return the nearest hits of rays with real surfaces."""
        si = self.real.ray_intersect(mi.Ray3f(origin, direction), active)
        hit = active & si.is_valid()
        distance = dr.norm(si.p)
        centre = dr.select(hit, si.p / distance, direction)
        return RealHit(
            hit,
            dr.select(hit, si.t, dr.inf),
            centre,
            dr.maximum(dr.abs(dr.dot(si.n, centre)), 1e-4),
            distance,
            dr.maximum(dr.abs(dr.dot(si.n, direction)), 1e-4),
        )

    def light_pdf(self, hit: RealHit, active: Any) -> Any:
        """Return the density, per solid angle at the rays' origins, of a hit by `sample_light`."""
        pdf = self._centre_pdf(hit.direction)
        at_point = pdf * hit.cosine_centre / hit.distance**2 * hit.t**2 / hit.cosine_ray
        # A ray that leaves is sampled only where the centre sees no surface either.
        open_sky = ~self.real.ray_test(
            mi.Ray3f(mi.Point3f(0.0), hit.direction), active & ~hit.valid
        )
        return dr.select(hit.valid, at_point, dr.select(open_sky, pdf, 0.0))

    def sample_light(self, origin: Any, sampler: Any, active: Any) -> tuple[Any, Any, Any, RealHit]:
        """Sample a direction towards real light.

        Chooses a texel in proportion to its luminance and solid angle, a point in it, and the
        surface seen there. Returns the direction, its density, whether real surfaces leave it
        unblocked, and the hit.
        """
        texel = self._texels.sample(sampler.next_1d(active), active)
        jitter = sampler.next_2d(active)
        column, row = mi.Float(texel % self.width), mi.Float(texel // self.width)
        towards = _equirect_direction(
            (column + jitter.x) / self.width, (row + jitter.y) / self.height
        )
        seen = self.hit_real(mi.Point3f(0.0), towards, active)
        offset = seen.direction * seen.t - origin
        distance = dr.select(seen.valid, dr.norm(offset), dr.inf)
        direction = dr.select(seen.valid, offset / distance, towards)
        # Again from the origin: the light is visible if it is the first hit.
        hit = self.hit_real(origin, direction, active)
        same = dr.select(
            seen.valid,
            hit.valid & (dr.abs(hit.t - distance) < 1e-3 * distance),
            ~hit.valid,
        )
        pdf = self.light_pdf(hit, active & same)
        return direction, pdf, active & same & (pdf > 0.0), hit

    def leaves(self, hit: RealHit) -> Any:
        """Return whether rays leave the real scene, through an opening too."""
        return ~hit.valid | ~self.receives(hit.direction)

    def sunlight(self, point: Any, sampler: Any, active: Any) -> tuple[Any, Any]:
        """Sample the sun.

        Returns the direction, and the irradiance of a surface perpendicular to it without objects.
        """
        if self._sun is None:
            return mi.Vector3f(0.0, 1.0, 0.0), mi.Color3f(0.0)
        towards = self._sun.sample(sampler, active)
        free = active & self.leaves(self.hit_real(point, towards, active))
        return towards, dr.select(free, self._sun.irradiance, 0.0)

    def lamplight(self, si: Any, origin: Any, sampler: Any, active: Any) -> tuple[Any, Any]:
        """Sample the lights without geometry from `origin`, just above the surfaces `si`.

        Returns the direction, and the irradiance across it.
        """
        if self._lights is None:
            return mi.Vector3f(0.0, 1.0, 0.0), mi.Color3f(0.0)
        seen, irradiance = self._lights.sample_emitter_direction(
            si, sampler.next_2d(active), False, active
        )
        free = active & (seen.pdf > 0.0)
        shadow = mi.Ray3f(origin, seen.d)
        shadow.maxt = seen.dist - LIFT * self.scale
        real = self.hit_real(origin, seen.d, free)
        # A distant light is seen where rays leave.
        distant = seen.dist > 1e3 * self.scale
        free &= dr.select(distant, self.leaves(real), real.t > shadow.maxt)
        free &= ~self.objects.ray_test(shadow, free)
        return seen.d, dr.select(free, irradiance, 0.0)

    def sun_seen(self, direction: Any, hit: RealHit) -> Any:
        """Return the sun's radiance along rays that end in `hit`."""
        if self._sun is None:
            return mi.Color3f(0.0)
        return dr.select(self.leaves(hit), self._sun.radiance(direction), 0.0)

    def _centre_pdf(self, direction: Any) -> Any:
        """Return the density per solid angle at the capture centre of sampled texels."""
        uv = _equirect_uv(direction)
        column = dr.minimum(mi.UInt32(uv.x * self.width), self.width - 1)
        row = dr.minimum(mi.UInt32(uv.y * self.height), self.height - 1)
        share = self._texels.eval_pmf_normalized(row * self.width + column)
        sine = dr.maximum(dr.safe_sqrt(1.0 - direction.y**2), 1e-5)
        texel = 2.0 * dr.pi / self.width * dr.pi / self.height
        return share / (texel * sine)

    @dr.syntax  # type: ignore[untyped-decorator]
    def reflected(self, ray: Any, si: Any, sampler: Any, active: Any) -> Any:
        """Return the radiance along `ray` from the virtual surfaces `si` that it meets."""
        active = mi.Bool(active)
        ray = mi.Ray3f(ray)
        throughput = mi.Color3f(1.0)
        total = mi.Color3f(0.0)
        bounce, depth = mi.UInt32(0), mi.UInt32(0)
        context = mi.BSDFContext()
        while active:
            # Lamps are found by chance.
            emission = si.emitter(self.objects, active).eval(si, active)
            total += dr.select(active, throughput * emission, 0.0)
            bsdf = si.bsdf()
            smooth = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            lift = self.scale * 1e-5
            # Direct light from real surfaces.
            lit = active & smooth
            towards, pdf, free, hit = self.sample_light(si.p + lift * si.n, sampler, lit)
            shadow = mi.Ray3f(si.spawn_ray(towards))
            shadow.maxt = hit.t
            free &= ~self.objects.ray_test(shadow, free)
            local = si.to_local(towards)
            value, pdf_bsdf = bsdf.eval_pdf(context, si, local, free)
            weight = pdf / (pdf + pdf_bsdf)
            light = self.radiance(hit.direction, relit=hit.valid)
            total += dr.select(free, throughput * value * light * weight / pdf, 0.0)
            towards, sun = self.sunlight(si.p + lift * si.n, sampler, lit)
            free = lit & (dr.max(sun) > 0.0)
            free &= ~self.objects.ray_test(mi.Ray3f(si.spawn_ray(towards)), free)
            value = bsdf.eval(context, si, si.to_local(towards), free)
            total += dr.select(free, throughput * value * sun, 0.0)
            towards, lamp = self.lamplight(si, si.p + lift * si.n, sampler, lit)
            value = bsdf.eval(context, si, si.to_local(towards), lit)
            total += dr.select(dr.max(lamp) > 0.0, throughput * value * lamp, 0.0)
            # BSDF sampling.
            sample, value = bsdf.sample(
                context, si, sampler.next_1d(active), sampler.next_2d(active), active
            )
            active &= sample.pdf > 0.0
            throughput *= dr.select(active, value, 0.0)
            active &= dr.max(throughput) > 0.0
            ray = mi.Ray3f(si.spawn_ray(si.to_world(sample.wo)))
            object_hit = self.objects.ray_intersect(ray, active)
            real = self.hit_real(ray.o, ray.d, active)
            again = active & object_hit.is_valid() & (object_hit.t < real.t)
            if dr.hint(self._absorbs, mode="scalar"):
                way = dr.minimum(object_hit.t, real.t)
                throughput *= _transmittance(si, ray.d, way, active & dr.isfinite(way))
            ends = active & ~again
            delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            pdf = dr.select(delta | ~smooth, 0.0, self.light_pdf(real, ends))
            weight = sample.pdf / (sample.pdf + pdf)
            light = self.radiance(real.direction, relit=real.valid)
            light += dr.select(delta, self.sun_seen(ray.d, real), 0.0)
            total += dr.select(ends, throughput * light * weight, 0.0)
            si = object_hit
            passes = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Transmission)
            bounce += dr.select(passes, mi.UInt32(0), mi.UInt32(1))
            depth += 1
            active = again & (bounce < BOUNCES) & (depth < SURFACES)
        return total

    def irradiance(
        self, point: Any, normal: Any, sampler: Any, active: Any
    ) -> tuple[Any, Any, Any]:
        """Return irradiance / pi of real surfaces without and with objects, and if one was hit.

        One cosine-distributed and one light sample with the balance heuristic, and one of the sun;
        the same rays for both irradiances.
        """
        origin = point + LIFT * self.scale * normal
        frame = mi.Frame3f(normal)
        local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d(active))
        ray = mi.Ray3f(origin, frame.to_world(local))
        real = self.hit_real(ray.o, ray.d, active)
        si = self.objects.ray_intersect(ray, active)
        blocked = active & si.is_valid() & (si.t < real.t)
        cosine = mi.warp.square_to_cosine_hemisphere_pdf(local)
        light = self.radiance(real.direction, relit=mi.Bool(False))
        light *= cosine / (cosine + self.light_pdf(real, active))
        without = dr.select(active, light, 0.0)
        both = dr.select(blocked, self.reflected(ray, si, sampler, blocked), without)

        towards, pdf, free, hit = self.sample_light(origin, sampler, active)
        cosine = dr.maximum(dr.dot(towards, normal), 0.0) / dr.pi
        free &= cosine > 0.0
        light = self.radiance(hit.direction, relit=mi.Bool(False)) * cosine / (cosine + pdf)
        shadow = mi.Ray3f(origin, towards)
        shadow.maxt = hit.t
        hidden = free & self.objects.ray_test(shadow, free)
        without += dr.select(free, light, 0.0)
        both += dr.select(free & ~hidden, light, 0.0)

        towards, sun = self.sunlight(origin, sampler, active)
        sun *= dr.maximum(dr.dot(towards, normal), 0.0) / dr.pi
        shaded = (dr.max(sun) > 0.0) & self.objects.ray_test(mi.Ray3f(origin, towards), active)
        without += sun
        both += dr.select(shaded, 0.0, sun)

        towards, lamp = self.lamplight(_surface(origin, normal), origin, sampler, active)
        lamp *= dr.maximum(dr.dot(towards, normal), 0.0) / dr.pi
        return without, both + lamp, blocked | hidden | shaded | (dr.max(lamp) > 0.0)


def _surface(point: Any, normal: Any) -> Any:
    """Return surfaces for the sampling of emitters."""
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(point))
    si.p, si.n, si.sh_frame = point, normal, mi.Frame3f(normal)
    return si


def _transmittance(si: Any, direction: Any, way: Any, active: Any) -> Any:
    """Return the transmittance of the medium that rays from surfaces `si` enter or stay in."""
    medium = si.target_medium(direction)
    inside = active & (medium != None)  # noqa: E711 (an array over rays)
    _, _, absorption = medium.get_scattering_coefficients(dr.zeros(mi.MediumInteraction3f), inside)
    return dr.select(inside, dr.exp(-mi.Color3f(absorption) * way), 1.0)


def _shape(positions: NDArray[np.float64], triangles: NDArray[np.int64]) -> Any:
    mesh = mi.Mesh("surface", vertex_count=len(positions), face_count=len(triangles))
    params = mi.traverse(mesh)
    params["vertex_positions"] = positions.astype(np.float32).ravel()
    params["faces"] = triangles.astype(np.uint32).ravel()
    params.update()
    return mesh


def _texture(image: NDArray[np.float32], *, nearest: bool = False) -> Any:
    """Return a bilinear lookup table with the scene format's texel centres."""
    wrapped = np.pad(image.astype(np.float32), ((0, 0), (1, 1), (0, 0)), mode="wrap")
    kind = dr.FilterMode.Nearest if nearest else dr.FilterMode.Linear
    return mi.Texture2f(mi.TensorXf(wrapped), filter_mode=kind, wrap_mode=dr.WrapMode.Clamp)


def _lookup(texture: Any, uv: Any, channels: int = 3) -> Any:
    width = texture.shape[1] - 2
    values = texture.eval(mi.Point2f((uv.x * width + 1.0) / (width + 2), uv.y))
    return mi.Color3f(*values[:3]) if channels == 3 else mi.Color3f(values[0])


def _equirect_uv(direction: Any) -> Any:
    u = dr.atan2(direction.x, -direction.z) / (2.0 * dr.pi) + 0.5
    v = dr.atan2(dr.sqrt(direction.x**2 + direction.z**2), direction.y) / dr.pi
    return mi.Point2f(dr.clip(u, 0.0, 1.0), dr.clip(v, 0.0, 1.0))


def _equirect_direction(u: Any, v: Any) -> Any:
    sin_phi, cos_phi = dr.sincos((u - 0.5) * 2.0 * dr.pi)
    sin_theta, cos_theta = dr.sincos(v * dr.pi)
    return mi.Vector3f(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
