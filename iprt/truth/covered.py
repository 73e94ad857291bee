"""Clearcoat, sheen and tint as a Mitsuba BSDF.

Mitsuba's `principled` defines these layers differently from glTF. This module
implements the functions of `cl/lib/world/cover.h` independently. It shares the tables of
reflectance.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from iprt.geometry.cover import CLEARCOAT_IOR, MIN_SHEEN_ALPHA, clearcoat_table, sheen_table
from iprt.geometry.material import Material
from iprt.truth.backend import mitsuba

LEAST_ALPHA = 0.01
"""GGX roughness in place of smooth layers, whose direction no density describes."""
SHARES = {"below": 0.5, "cosine": 0.25, "clearcoat": 0.25}
"""Probabilities of the ways to sample a direction."""


def covered(material: Material, below: dict[str, Any]) -> Any:
    """Return the layers of a principled material above a Mitsuba BSDF.

    Parameters
    ----------
    material : Material
        Its clearcoat, sheen and tint are used; of a map of metalness, the mean.
    below : dict
        BSDF of the same material without layers, and without smooth lobes.

    Returns
    -------
    Mitsuba BSDF
        Of the front side.
    """
    mi = mitsuba()
    dr = import_module("drjit")

    def distribution(alpha: float) -> Any:
        return mi.MicrofacetDistribution(
            mi.MicrofacetType.GGX, max(alpha, LEAST_ALPHA), sample_visible=True
        )

    surface = material.maps[1]
    metallic = material.metallic * (1.0 if surface is None else float(surface[..., 0].mean()))
    coat_alpha = max(material.clearcoat_alpha, LEAST_ALPHA)
    sheen_alpha = max(material.sheen_alpha, MIN_SHEEN_ALPHA)
    tables = [
        mi.Float(np.ravel(table))
        for table in (clearcoat_table(material.clearcoat_alpha), sheen_table(sheen_alpha))
    ]

    def share(table: Any, cosine: Any) -> Any:
        """Interpolate a table over the square root of the cosine."""
        steps = dr.width(table) - 1
        x = dr.sqrt(dr.clip(cosine, 0.0, 1.0)) * steps
        low = dr.minimum(mi.UInt32(x), steps - 1)
        part = x - mi.Float(low)
        first = dr.gather(mi.Float, table, low)
        return dr.lerp(first, dr.gather(mi.Float, table, low + 1), part)

    def most(table: Any, wi: Any, wo: Any) -> Any:
        cosines = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
        return dr.maximum(*(share(table, cosine) for cosine in cosines))

    def slope(v: Any, alpha: float) -> Any:
        return dr.sqrt(v.z**2 + alpha**2 * (v.x**2 + v.y**2))

    class Covered(mi.BSDF):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            self._below = mi.load_dict(below)
            self._coat, self._plastic = distribution(coat_alpha), distribution(material.alpha)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components, self.m_flags = [flags], flags

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            wi, h = si.wi, dr.normalize(si.wi + wo)
            active &= (wi.z > 0.0) & (wo.z > 0.0)
            value, density = self._below.eval_pdf(ctx, si, wo, active)
            cos_h = dr.dot(wi, h)
            fade = (1.0 - mi.Color3f(*material.tint)) * (1.0 - (1.0 - cos_h) ** 5)
            plain = (1.0 - metallic) * mi.fresnel(cos_h, material.ior)[0] * self._plastic.eval(h)
            value -= fade * plain * self._plastic.G(wi, wo, h) / (4.0 * wi.z)
            coat, white = (most(table, wi, wo) for table in tables)
            coat *= material.clearcoat
            value *= 1.0 - max(material.sheen) * dr.minimum(white, 1.0)

            sine = dr.safe_sqrt(1.0 - h.z**2)
            lobe = (2.0 + 1.0 / sheen_alpha) * sine ** (1.0 / sheen_alpha) / dr.two_pi
            visible = 0.25 / (wi.z + wo.z - wi.z * wo.z)
            value += mi.Color3f(*material.sheen) * lobe * visible * wo.z / dr.maximum(white, 1.0)
            value *= 1.0 - coat

            masked = wo.z * slope(wi, coat_alpha) + wi.z * slope(wo, coat_alpha)
            mirrored = mi.fresnel(cos_h, CLEARCOAT_IOR)[0] * self._coat.eval(h)
            value += material.clearcoat * mirrored * wo.z / (2.0 * masked)

            density *= SHARES["below"]
            density += SHARES["cosine"] * wo.z / dr.pi
            density += SHARES["clearcoat"] * self._coat.pdf(wi, h) / (4.0 * dr.maximum(cos_h, 1e-6))
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
            normal, _ = self._coat.sample(si.wi, sample2)
            drawn.wo = dr.select(below, drawn.wo, mi.reflect(si.wi, normal))
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
