"""Clearcoat, sheen and tint as a Mitsuba BSDF.

Mitsuba's `principled` defines these layers differently from glTF. This module
implements the functions of `cl/lib/world/cover.h` independently. It shares the tables of
reflectance. Of the values that vary over a surface, it reads a texel drawn at random among the four
around a point, as the renderer does.
"""

from __future__ import annotations

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np

from iprt.device.kernel_source import constant
from iprt.geometry.cover import CLEARCOAT_IOR, MIN_SHEEN_ALPHA, clearcoat_table, sheen_table
from iprt.geometry.material import Material
from iprt.geometry.sampler import Wrap
from iprt.truth.backend import mitsuba

LEAST_ALPHA = 0.01
"""GGX roughness in place of smooth layers, whose direction no density describes."""
NODES = constant("lib/world/cover.h", "COVER_NODES")
SHARES = {"below": 0.5, "cosine": 0.25, "clearcoat": 0.25}
"""Probabilities of the ways to sample a direction."""


def covered(
    material: Material,
    below: dict[str, Any],
    bumps: dict[str, Any] | None = None,
    lacquer: dict[str, Any] | None = None,
) -> Any:
    """Return the layers of a principled material above a Mitsuba BSDF.

    Parameters
    ----------
    material : Material
        Its clearcoat, sheen and tint are used, and their variants; of a map of metalness, the mean.
    below : dict
        BSDF of the same material without layers, and without smooth lobes.
    bumps, lacquer : dict or None
        Textures of the normals of `below`, and of the clear coat's; vectors are 0.5 (1 + v).

    Returns
    -------
    Mitsuba BSDF
        Of the front side.
    """
    mi = mitsuba()
    dr = import_module("drjit")
    layers = _Layers(material, bumps, lacquer)

    def distribution(alpha: Any) -> Any:
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, sample_visible=True)

    surface = material.maps[1]
    metallic = material.metallic * (1.0 if surface is None else float(surface[..., 0].mean()))

    def share(table: Any, first: Any, cosine: Any) -> Any:
        """Interpolate a table over the square root of the cosine."""
        x = dr.sqrt(dr.clip(cosine, 0.0, 1.0)) * (NODES - 1)
        low = dr.minimum(mi.UInt32(x), NODES - 2)
        part = x - mi.Float(low)
        value = dr.gather(mi.Float, table, first + low)
        return dr.lerp(value, dr.gather(mi.Float, table, first + low + 1), part)

    def most(table: Any, first: Any, wi: Any, wo: Any) -> Any:
        return dr.maximum(*(share(table, first, direction.z) for direction in (wi, wo)))

    def slope(v: Any, alpha: Any) -> Any:
        return dr.sqrt(v.z**2 + alpha**2 * (v.x**2 + v.y**2))

    class Covered(mi.BSDF):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            self._below = mi.load_dict(below)
            self._plastic = distribution(max(material.alpha, LEAST_ALPHA))
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components, self.m_flags = [flags], flags

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            half, at = dr.normalize(si.wi + wo), layers.at(si)
            active &= (si.wi.z > 0.0) & (wo.z > 0.0)
            value, density = self._below.eval_pdf(ctx, si, wo, active)
            density *= SHARES["below"]
            density += SHARES["cosine"] * wo.z / dr.pi
            cos_h = dr.dot(si.wi, half)
            wi, wo, h = (at.coat.to_local(direction) for direction in (si.wi, wo, half))
            coat = at.clearcoat * most(layers.clearcoats, at.first, wi, wo)
            lacquered = active & (wi.z > 0.0) & (wo.z > 0.0)
            masked = wo.z * slope(wi, at.clearcoat_alpha) + wi.z * slope(wo, at.clearcoat_alpha)
            facets = distribution(at.clearcoat_alpha)
            mirrored = mi.fresnel(cos_h, CLEARCOAT_IOR)[0] * facets.eval(h)
            mirrored *= at.clearcoat * wo.z / (2.0 * masked)
            drawn = facets.pdf(wi, h) / (4.0 * dr.maximum(cos_h, 1e-6))
            density += dr.select(lacquered, SHARES["clearcoat"] * drawn, 0.0)

            wi, wo, h = (at.base.to_local(at.coat.to_world(direction)) for direction in (wi, wo, h))
            fade = (1.0 - at.tint) * (1.0 - (1.0 - cos_h) ** 5)
            plain = (1.0 - metallic) * mi.fresnel(cos_h, material.ior)[0] * self._plastic.eval(h)
            value -= fade * plain * self._plastic.G(wi, wo, h) / (4.0 * wi.z)
            white = most(layers.sheens, at.first, wi, wo)
            value *= 1.0 - dr.max(at.sheen) * dr.minimum(white, 1.0)

            sine = dr.safe_sqrt(1.0 - h.z**2)
            lobe = (2.0 + 1.0 / at.sheen_alpha) * sine ** (1.0 / at.sheen_alpha) / dr.two_pi
            visible = 0.25 / (wi.z + wo.z - wi.z * wo.z)
            value += at.sheen * lobe * visible * wo.z / dr.maximum(white, 1.0)
            value = dr.select((wi.z > 0.0) & (wo.z > 0.0), (1.0 - coat) * value, 0.0)
            value += dr.select(lacquered, mirrored, 0.0)
            return dr.select(active, value, 0.0), dr.select(active, density, 0.0)

        def sample(
            self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            active &= si.wi.z > 0.0
            below = sample1 < SHARES["below"]
            cosine = ~below & (sample1 < SHARES["below"] + SHARES["cosine"])
            drawn, _ = self._below.sample(
                ctx, si, sample1 / SHARES["below"], sample2, active & below
            )
            at = layers.at(si)
            wi = at.coat.to_local(si.wi)
            normal, _ = distribution(at.clearcoat_alpha).sample(wi, sample2)
            drawn.wo = dr.select(below, drawn.wo, at.coat.to_world(mi.reflect(wi, normal)))
            hemisphere = mi.warp.square_to_cosine_hemisphere(sample2)
            drawn.wo = dr.select(cosine, hemisphere, drawn.wo)
            value, drawn.pdf = self.eval_pdf(ctx, si, drawn.wo, active)
            drawn.eta = 1.0
            drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            drawn.sampled_component = mi.UInt32(0)
            found = active & (drawn.pdf > 0.0)
            return drawn, dr.select(found, value / drawn.pdf, 0.0)

        def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
            return self._below.eval_diffuse_reflectance(si, active)

        def to_string(self) -> str:
            return "Covered[]"

    return Covered()


class _Layers:
    """The layers of a material and of its variants, on Mitsuba's device.

    Attributes
    ----------
    clearcoats, sheens : mi.Float
        `NODES` values of the tables of reflectance, per variant.
    """

    def __init__(
        self, material: Material, bumps: dict[str, Any] | None, lacquer: dict[str, Any] | None
    ) -> None:
        mi = mitsuba()
        self._bumps, self._lacquer = (
            None if one is None else mi.load_dict(one) for one in (bumps, lacquer)
        )
        variants = material.palette or (material,)
        self._map = material.variants if material.palette else None
        self.clearcoats = mi.Float(
            np.ravel([clearcoat_table(one.clearcoat_alpha) for one in variants])
        )
        sheen_alphas = [max(one.sheen_alpha, MIN_SHEEN_ALPHA) for one in variants]
        self.sheens = mi.Float(np.ravel([sheen_table(alpha) for alpha in sheen_alphas]))
        self._sheen_alpha = mi.Float(sheen_alphas)
        self._clearcoat = mi.Float([one.clearcoat for one in variants])
        alphas = [max(one.clearcoat_alpha, LEAST_ALPHA) for one in variants]
        self._clearcoat_alpha = mi.Float(alphas)
        self._sheen, self._tint = (
            mi.Float(np.ravel(colors))
            for colors in ([one.sheen for one in variants], [one.tint for one in variants])
        )
        if self._map is not None:
            self._index = mi.UInt32(self._map.index.ravel())

    def at(self, si: Any) -> Any:
        """Return the layers at interactions: frames, values, and the place of their tables."""
        mi, dr = mitsuba(), import_module("drjit")
        index = self._drawn(si)
        return SimpleNamespace(
            base=_frame(self._bumps, si),
            coat=_frame(self._lacquer, si),
            first=NODES * index,
            clearcoat=dr.gather(mi.Float, self._clearcoat, index),
            clearcoat_alpha=dr.gather(mi.Float, self._clearcoat_alpha, index),
            sheen=dr.gather(mi.Color3f, self._sheen, index),
            sheen_alpha=dr.gather(mi.Float, self._sheen_alpha, index),
            tint=dr.gather(mi.Color3f, self._tint, index),
        )

    def _drawn(self, si: Any) -> Any:
        """Return the variant of a texel at interactions, the same for the same place."""
        mi, dr = mitsuba(), import_module("drjit")
        if self._map is None:
            return mi.UInt32(0)
        height, width = self._map.index.shape
        bits = [dr.reinterpret_array(mi.UInt32, mi.Float(part)) for part in (si.uv.x, si.uv.y)]
        scale = 0.0 if self._map.sampler.nearest else 2.0**-32
        random = [scale * mi.Float(part) - 0.5 * (scale > 0.0) for part in mi.sample_tea_32(*bits)]
        u, v = (
            _wrapped(part, wrap)
            for part, wrap in zip(
                (si.uv.x + random[0] / width, 1.0 - si.uv.y - random[1] / height),
                self._map.sampler.wrap,
                strict=True,
            )
        )
        column = dr.clip(mi.Int32(dr.floor(u * width)), 0, width - 1)
        row = dr.clip(mi.Int32(dr.floor(v * height)), 0, height - 1)
        return dr.gather(mi.UInt32, self._index, mi.UInt32(row * width + column))


def _frame(normals: Any, si: Any) -> Any:
    """Return the frame of a map's normals at interactions, whose own frame it is without."""
    mi, dr = mitsuba(), import_module("drjit")
    if normals is None:
        return mi.Frame3f(mi.Vector3f(0.0, 0.0, 1.0))
    return mi.Frame3f(dr.normalize(mi.Vector3f(2.0 * normals.eval_3(si) - 1.0)))


def _wrapped(part: Any, wrap: Wrap) -> Any:
    """Return coordinates in [0, 1] of a texture that is read beyond."""
    dr = import_module("drjit")
    if wrap == "clamp":
        return dr.clip(part, 0.0, 1.0)
    if wrap == "mirror":
        return 1.0 - abs(1.0 - (part - 2.0 * dr.floor(0.5 * part)))
    return part - dr.floor(part)
