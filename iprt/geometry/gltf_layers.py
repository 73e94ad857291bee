"""Values of glTF materials that kernels read by the index of a material, texel by texel.

KHR_materials_clearcoat, _sheen, _specular and _transmission.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.files.images import decode_srgb
from iprt.geometry.gltf_surfaces import GltfMaterial, TextureReference
from iprt.geometry.layers import Layers
from iprt.geometry.material import Material
from iprt.geometry.reflectance import LEAST_IOR, MAX_IOR, NEARLY, color_of, plain_alpha, triple
from iprt.geometry.textures import ALPHA, GREEN, RED, Textures
from iprt.geometry.variants import Float, distinct

Picture = Callable[[TextureReference | None], Image.Image | None]
RGB = RED, GREEN, 2
CHANNELS = {
    "clearcoat": (RED,),
    "clearcoat roughness": (GREEN,),
    "sheen": RGB,
    "sheen roughness": (ALPHA,),
    "specular": (ALPHA,),
    "specular color": RGB,
    "transmission": (RED,),
}
"""Channels of the textures of `GltfMaterial.varying`."""
MAX_REFLECTANCE = 0.36
"""Reflectance of `MAX_IOR` at normal incidence."""


def layers_of(source: GltfMaterial, picture: Picture, textures: Textures) -> Layers:
    """Return the values of a material at its texels, as many as its largest maps have.

    `picture` returns the decoded image of a texture. Smaller images are enlarged by interpolation.

    Raises
    ------
    FormatError
        An image is damaged or of an unread format, or the total of texels is too large.
    """
    pictures = {name: picture(one) for name, one in source.varying().items()}
    found = {name: one for name, one in pictures.items() if one is not None}
    sizes = [one.size for one in found.values()]
    width, height = (max((size[axis] for size in sizes), default=1) for axis in (0, 1))
    planes, columns = [np.zeros(width * height, np.uint8)], {}
    for name, image in found.items():
        pixels = textures.channels(image, (width, height))[..., list(CHANNELS[name])]
        columns[name] = slice(len(planes), len(planes) + pixels.shape[-1])
        planes += [*pixels.reshape(-1, pixels.shape[-1]).T]
    if found:
        textures.count(width * height)
    values, number = distinct(np.stack(planes))
    texels = {name: values[:, column] for name, column in columns.items()}
    weights = np.bincount(number).astype(np.float64)
    return _scaled(source, texels, weights, number.reshape(height, width))


def _scaled(
    source: GltfMaterial,
    texels: dict[str, NDArray[np.uint8]],
    weights: Float,
    number: NDArray[np.int64],
) -> Layers:
    """Return texels (N, 1 or 3) times the material's factors."""
    one = np.ones(len(weights))

    def plain(name: str) -> Float:
        return np.asarray(texels[name][:, 0] / 255.0) if name in texels else one

    def color(name: str) -> Float:
        if name not in texels:
            return np.ones((len(one), 3))
        return decode_srgb(texels[name]).astype(np.float64)

    coat, sheen, specular = source.clearcoat, source.sheen, source.specular
    strength, coat_alpha, fibres, sheen_alpha = 0.0, 0.0, (0.0, 0.0, 0.0), Material.sheen_alpha
    if coat is not None and coat.clearcoat_factor > 0.0:
        strength = min(coat.clearcoat_factor, 1.0)
        coat_alpha = plain_alpha(coat.clearcoat_roughness_factor)
    if sheen is not None and max(color_of(sheen.sheen_color_factor)) > 0.0:
        fibres = color_of(sheen.sheen_color_factor)
        sheen_alpha = plain_alpha(sheen.sheen_roughness_factor)
    reflected = np.ones(3)
    if specular is not None:
        reflected = specular.specular_factor * np.array(
            triple(specular.specular_color_factor, np.inf)
        )
    passing = 0.0
    if source.transmission is not None and source.transmission.transmission_factor > NEARLY:
        passing = min(source.transmission.transmission_factor, 1.0)
    return Layers(
        strength * plain("clearcoat"),
        coat_alpha * plain("clearcoat roughness") ** 2,
        np.array(fibres) * color("sheen"),
        sheen_alpha * plain("sheen roughness") ** 2,
        plain("specular")[:, None] * reflected * color("specular color"),
        passing * plain("transmission"),
        weights,
        number,
    )


def index_of_refraction(source: GltfMaterial, specular: Float) -> float:
    """Return the index of refraction whose reflectance at normal incidence is the material's.

    KHR_materials_specular multiplies that reflectance by the greatest channel of `specular` (3,), a
    row of `Layers`; `tint_of` has the others.
    """
    ior = Material.ior if source.refraction is None else source.refraction.ior
    ior = MAX_IOR if ior == 0.0 else ior  # 0 stands for a reflectance of 1
    if source.specular is not None and ior > 0.0:
        reflectance = float(specular.max()) * ((ior - 1.0) / (ior + 1.0)) ** 2
        root = float(np.sqrt(np.clip(reflectance, 0.0, MAX_REFLECTANCE)))
        ior = (1.0 + root) / (1.0 - root)
    return min(max(ior, LEAST_IOR), MAX_IOR)
