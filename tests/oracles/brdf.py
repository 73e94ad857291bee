"""Float64 twins of `cl/lib/world/brdf.h`, in the local frame of the surface (normal +z).

Everything is written from the textbook definitions (angles, tangents, explicit half vectors), not
from the rearranged forms that the kernels use.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import MIN_ALPHA, MIRROR_ALPHA, Material, material_table

Array = NDArray[np.float64]
MIN_LOBE = 0.25
Z = np.array([0.0, 0.0, 1.0])
"""The shading normal, which is the clearcoat's too where none is given."""


@lru_cache
def nodes_and_weights(count: int) -> tuple[Array, Array]:
    """Gauss-Legendre quadrature on -1..1."""
    x, weight = np.polynomial.legendre.leggauss(count)
    return x, weight


def roughness(material: Material) -> float:
    return 0.0 if material.alpha < MIRROR_ALPHA else max(material.alpha, MIN_ALPHA)


def normalized(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def direction(theta_deg: float, phi_deg: float = 0.0) -> Array:
    theta, phi = np.radians([theta_deg, phi_deg])
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def fresnel(cosine: Array, ior: float) -> Array:
    """From Snell's law and the Fresnel equations for both polarizations."""
    theta_i = np.arccos(np.clip(cosine, 0, 1))
    theta_t = np.arcsin(np.clip(np.sin(theta_i) / ior, 0, 1))  # above 1: total reflection
    cos_i, cos_t = np.cos(theta_i), np.cos(theta_t)
    s = (cos_i - ior * cos_t) / (cos_i + ior * cos_t)
    p = (cos_t - ior * cos_i) / (cos_t + ior * cos_i)
    return (s**2 + p**2) / 2


def smith_lambda(v: Array, alpha: float) -> Array:
    tan2 = (v[..., 0] ** 2 + v[..., 1] ** 2) / v[..., 2] ** 2
    return (np.sqrt(1 + alpha**2 * tan2) - 1) / 2


def ggx(h: Array, alpha: float) -> Array:
    cos2 = h[..., 2] ** 2
    tan2 = (h[..., 0] ** 2 + h[..., 1] ** 2) / cos2
    return 1 / (np.pi * alpha**2 * cos2**2 * (1 + tan2 / alpha**2) ** 2)


def half(o: Array, i: Array) -> Array:
    return normalized(o + i)


def reflectance(material: Material, cos_h: Array) -> Array:
    coat = np.broadcast_to(fresnel(cos_h, material.ior)[..., None], (*cos_h.shape, 3))
    if material.kind == "principled":
        coat = coat * (1 - (1 - np.array(material.tint)) * (1 - (1 - cos_h[..., None]) ** 5))
    if material.kind == "plastic":
        return coat
    albedo = np.broadcast_to(np.array(material.albedo), (*cos_h.shape, 3))
    if material.kind == "principled":
        metal = albedo + (1 - albedo) * (1 - cos_h[..., None]) ** 5
        return material.metallic * metal + (1 - material.metallic) * coat
    return albedo


def microfacets(alpha: float, o: Array, i: Array, separable: bool = False) -> Array:
    """D G2 / (4 cos_i cos_o), G2 height-correlated, or the product of two G1 as in Mitsuba if
    `separable`."""
    lambda_o, lambda_i = smith_lambda(o, alpha), smith_lambda(i, alpha)
    g2 = 1 / (1 + lambda_o + lambda_i + separable * lambda_o * lambda_i)
    return ggx(half(o, i), alpha) * g2 / (4 * o[..., 2] * i[..., 2])


def around(normal: Array, v: Array) -> Array:
    """Directions in a frame whose z is this normal."""
    x = normalized(np.cross(normal, [0.36, 0.48, 0.8]) if np.any(normal != Z) else [1.0, 0, 0])
    return v @ np.stack([x, np.cross(normal, x), normal], axis=-1)


def evaluate_specular(
    material: Material, o: Array, i: Array, separable: bool = False, coat: Array = Z
) -> Array:
    """f of the rough specular lobes and of sheen."""
    alpha, cos_h = roughness(material), np.sum(o * half(o, i), -1)
    value = np.zeros(i.shape)
    if alpha > 0:
        value = microfacets(alpha, o, i, separable)[..., None] * reflectance(material, cos_h)
    if not material.is_covered:
        return value
    value = value * below_cover(material, o, i, coat)[..., None] + sheen(material, o, i, coat)
    return value + clearcoat(material, o, i, coat)[..., None]


def clearcoat(material: Material, o: Array, i: Array, coat: Array = Z) -> Array:
    """f of the rough clearcoat, relative to the cosine's magnitude at the shading normal."""
    if not (alpha := coat_roughness(material)) > 0:
        return np.zeros(i.shape[:-1])
    own_o, own_i = around(coat, o), around(coat, i)
    above = own_i[..., 2] > 0
    own_i = np.where(above[..., None], own_i, Z)
    f = fresnel(np.sum(o * half(o, i), -1), 1.5) * microfacets(alpha, own_o, own_i)
    return np.where(above, material.clearcoat * f * own_i[..., 2] / np.abs(i[..., 2]), 0.0)


def coat_roughness(material: Material) -> float:
    return roughness(replace(material, alpha=material.clearcoat_alpha))


def covers(material: Material, v: Array, coat: Array = Z) -> Array:
    """(2, ...) share of light that the clearcoat and white sheen, unlimited, reflect: the table's
    piecewise linear values."""
    rows = table(material)
    found = [
        np.interp(np.sqrt(cosine), np.linspace(0, 1, 32), rows[first : first + 8].ravel())
        for first, cosine in ((14, np.maximum(v @ coat, 0.0)), (22, v[..., 2]))
    ]
    return np.stack([material.clearcoat * found[0], found[1]])


def most_covers(material: Material, o: Array, i: Array, coat: Array = Z) -> Array:
    """`covers` of the direction in which more is reflected."""
    o = np.broadcast_to(o, i.shape)
    return np.maximum(covers(material, o, coat), covers(material, i, coat))


def below_cover(material: Material, o: Array, i: Array, coat: Array = Z) -> Array:
    """Factor of all that is below both layers."""
    share, white = most_covers(material, o, i, coat)
    return (1 - share) * (1 - max(material.sheen) * np.minimum(white, 1))


def sheen(material: Material, o: Array, i: Array, coat: Array = Z) -> Array:
    """Estevez and Kulla's distribution with Neubelt and Pettineo's visibility, limited."""
    alpha = max(material.sheen_alpha, 0.01)
    share, white = most_covers(material, o, i, coat)
    sine = np.sin(np.arccos(np.clip(half(o, i)[..., 2], -1, 1)))
    distribution = (2 + 1 / alpha) * sine ** (1 / alpha) / (2 * np.pi)
    visibility = 1 / (4 * (o[..., 2] + i[..., 2] - o[..., 2] * i[..., 2]))
    value = (1 - share) * distribution * visibility / np.maximum(white, 1)
    return value[..., None] * np.array(material.sheen)


@lru_cache
def table(material: Material) -> Array:
    return material_table([material]).astype(np.float64)


def transmittance(material: Material, cosine: Array) -> Array:
    """The table's piecewise linear transmittance at these cosines."""
    nodes = table(material)[1:9].ravel()
    return np.interp(np.sqrt(cosine), np.linspace(0, 1, len(nodes)), nodes)


def base(material: Material) -> float:
    return float(table(material)[0, 3])


def evaluate_diffuse(material: Material, o: Array, i: Array, coat: Array = Z) -> Array:
    """f of the diffuse lobe, without the albedo."""
    if material.kind == "diffuse":
        return np.full(i.shape[:-1], 1 / np.pi)
    if is_specular(material):
        return np.zeros(i.shape[:-1])
    crossed = transmittance(material, o[..., 2]) * transmittance(material, i[..., 2])
    if material.is_covered:
        crossed = crossed * below_cover(material, o, i, coat)
    return crossed * base(material) / np.pi


def is_specular(material: Material) -> bool:
    return material.kind == "conductor" or (
        material.kind == "principled" and material.metallic == 1
    )


def specular_probability(material: Material, o: Array) -> float:
    if material.kind == "diffuse" or is_specular(material):
        return float(is_specular(material))
    crossed = float(transmittance(material, o[..., 2]))
    luminance = float(np.dot([0.2126, 0.7152, 0.0722], material.albedo))
    metallic = material.metallic if material.kind == "principled" else 0.0
    specular = (1 - metallic) * (1 - crossed) + metallic * luminance
    diffuse = (1 - metallic) * luminance * base(material) * crossed
    return float(np.clip(specular / (specular + diffuse), MIN_LOBE, 1 - MIN_LOBE))


def lobe_probabilities(material: Material, o: Array, coat: Array = Z) -> tuple[float, float]:
    """Of the specular lobe and of the clearcoat."""
    specular = specular_probability(material, o)
    if not material.is_covered:
        return specular, 0.0
    lacquer, white = covers(material, o, coat)
    chosen = [
        float(np.clip(share, MIN_LOBE, 1 - MIN_LOBE)) if strength > 0 else 0.0
        for share, strength in (
            (lacquer, material.clearcoat),
            (max(material.sheen) * white, max(material.sheen)),
        )
    ]
    return specular * (1 - chosen[1]) * (1 - chosen[0]), chosen[0]


def density(material: Material, o: Array, i: Array, coat: Array = Z) -> Array:
    """(..., 2): 1/sr of the diffuse and the specular lobes, probabilities included."""
    p, p_coat = lobe_probabilities(material, o, coat)
    out = np.zeros((*i.shape[:-1], 2))
    out[..., 0] = (1 - p - p_coat) * np.maximum(i[..., 2], 0.0) / np.pi
    lobes = [(p, roughness(material), Z), (p_coat, coat_roughness(material), coat)]
    for probability, alpha, normal in lobes if material.kind != "diffuse" else ():
        if alpha > 0:
            h, own = around(normal, half(o, i)), around(normal, o)
            cos_h = np.sum(own * h, -1)
            visible = ggx(h, alpha) * cos_h / (1 + smith_lambda(own, alpha)) / own[..., 2]
            found = probability * visible / (4 * np.maximum(cos_h, 1e-12))
            out[..., 1] += np.where(h[..., 2] > 0, found, 0.0)
    return out


def specular_albedo(
    material: Material, o: Array, separable: bool = False, nodes: int = 250
) -> Array:
    """(3,) share of light from direction o that the rough lobe reflects."""
    return over_slopes(
        roughness(material), o, lambda o, i: evaluate_specular(material, o, i, separable), nodes
    )


def over_slopes(
    alpha: float, o: Array, value: Callable[[Array, Array], Array], nodes: int = 250
) -> Array:
    """(3,) integral of f cos for a lobe of this roughness, by quadrature over the distribution's
    slopes: independent of any sampling routine."""
    o = np.array([np.hypot(o[0], o[1]), 0, o[2]])  # so that half a turn of azimuth suffices
    # Normals by tan(theta_h) = alpha tan(w): the lobe's width is divided out. dw_h carries D.
    x, weight = nodes_and_weights(nodes)
    w = (x + 1) * np.pi / 4
    phi = (np.arange(nodes) + 0.5) * np.pi / nodes
    theta = np.arctan(alpha * np.tan(w))
    jacobian = alpha / np.cos(w) ** 2 / (1 + (alpha * np.tan(w)) ** 2)
    h = np.stack(
        np.broadcast_arrays(
            np.sin(theta)[:, None] * np.cos(phi),
            np.sin(theta)[:, None] * np.sin(phi),
            np.cos(theta)[:, None],
        ),
        axis=-1,
    )
    cos_h = h @ o
    i = 2 * cos_h[..., None] * h - o
    seen = (cos_h > 0) & (i[..., 2] > 0)
    i = np.where(seen[..., None], i, [0, 0, 1])
    f = value(o, i) * np.where(seen, i[..., 2] * 4 * cos_h, 0)[..., None]
    solid_angle = weight * np.pi / 4 * np.sin(theta) * jacobian * 2 * np.pi / nodes
    return np.einsum("wpc,w->c", f, solid_angle)


def over_hemisphere(o: Array, value: Callable[[Array, Array], Array], nodes: int = 256) -> Array:
    """(3,) integral of f cos by quadrature that is fine at grazing angles, for wide lobes."""
    x, weight = nodes_and_weights(nodes)
    cosine = ((x + 1) / 2) ** 2
    phi = (np.arange(nodes) + 0.5) * 2 * np.pi / nodes
    sine = np.sqrt(1 - cosine**2)[:, None]
    i = np.stack(
        np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), cosine[:, None]), axis=-1
    )
    mean = value(np.broadcast_to(o, i.shape), i).mean(axis=1)
    return 2 * np.pi * np.einsum("zc,z->c", mean, weight * (x + 1) / 2 * cosine)


def covered_albedo(material: Material, o: Array) -> dict[str, Array]:
    """(3,) share of light from o that each layer of a covered material reflects."""
    alpha, coat_alpha = roughness(material), coat_roughness(material)

    def coat(o: Array, i: Array) -> Array:
        cos_h = np.sum(o * half(o, i), -1)
        return (fresnel(cos_h, 1.5) * microfacets(coat_alpha, o, i))[..., None] * np.ones(3)

    def specular(o: Array, i: Array) -> Array:
        f = microfacets(alpha, o, i)[..., None] * reflectance(material, np.sum(o * half(o, i), -1))
        return f * below_cover(material, o, i)[..., None]

    smooth_coat, smooth = (
        fresnel(o[2], 1.5) * np.ones(3),
        reflectance(material, o[2:])[0] * below_cover(material, o, o),
    )
    diffuse = 0.0 if is_specular(material) else diffuse_albedo(material, o)
    return {
        "clearcoat": material.clearcoat
        * (over_slopes(coat_alpha, o, coat) if coat_alpha else smooth_coat),
        "sheen": over_hemisphere(o, lambda o, i: sheen(material, o, i)),
        "specular": over_slopes(alpha, o, specular) if alpha else smooth,
        "diffuse": (1 - material.metallic) * diffuse * np.array(material.albedo),
    }


def diffuse_albedo(material: Material, o: Array) -> float:
    """Share of light from o that the diffuse lobe reflects at albedo 1."""
    x, weight = nodes_and_weights(256)
    cosine = (x + 1) / 2
    i = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], -1)
    f = evaluate_diffuse(material, np.broadcast_to(o, i.shape), i)
    return float(np.sum(f * cosine * weight / 2) * 2 * np.pi)
