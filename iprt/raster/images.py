"""Textures of materials on the graphics device."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import Material
from iprt.geometry.place import Place, upright
from iprt.geometry.sampler import Sampler
from iprt.geometry.variants import Variants

IMAGES = "image", "finish_image", "normal_image", "emission_image"
"""Textures of `glsl/shade.frag`, in the order of `Material.maps`, of which it lacks the last."""

VARIANTS = "variant_image"
"""Texture of the same of `Material.variants`."""


def images_of(
    context: moderngl.Context, material: Material, *, variants: bool
) -> dict[str, moderngl.Texture]:
    """Upload a material's textures; a missing one is a single texel without effect."""
    flat = (1.0, 1.0, 1.0), (1.0, 1.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0)
    named = zip(IMAGES, flat, material.maps, material.samplers, strict=False)
    images = {
        name: _mipmapped(context, np.array([[plain]], np.float32) if one is None else one, sampler)
        for name, plain, one, sampler in named
    }
    if variants:
        # Samplers of integers and of floats must not share a texture.
        none = Variants((), (), np.zeros((1, 1), np.uint8))
        images[VARIANTS] = _indices(context, material.variants or none)
    return images


def _indices(context: moderngl.Context, variants: Variants) -> moderngl.Texture:
    """Upload a map of variants, whose nearest texel is read."""
    height, width = variants.index.shape
    texture = context.texture((width, height), 1, variants.index.tobytes(), alignment=1, dtype="u1")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x, texture.repeat_y = (wrap == "repeat" for wrap in variants.sampler.wrap)
    return texture


def reading(material: Material) -> dict[str, object]:
    """Return the uniforms by which `glsl/shade.frag` reads textures: mirroring and places."""
    samplers = dict(zip(IMAGES, material.samplers, strict=False))
    if material.variants is not None:
        samplers[VARIANTS] = material.variants.sampler
    uniforms: dict[str, object] = {
        f"{name}_mirrored": (sampler.wrap[0] == "mirror", sampler.wrap[1] == "mirror")
        for name, sampler in samplers.items()
    }
    for name, given in zip(IMAGES[1:], material.places, strict=False):
        place = given or Place()
        # Columns of the matrix.
        columns = zip(*upright(place.matrix), strict=True)
        uniforms[f"{name}_place"] = tuple(value for column in columns for value in column)
        uniforms[f"{name}_second"] = place.second
    return uniforms


def _mipmapped(
    context: moderngl.Context, image: NDArray[np.float32], sampler: Sampler
) -> moderngl.Texture:
    """Upload a mipmapped texture in half floats, which keep 11 bits of an albedo in [0, 1]."""
    height, width, channels = image.shape
    data = np.ascontiguousarray(image, np.float16).tobytes()
    texture = context.texture((width, height), channels, data, dtype="f2")
    texture.build_mipmaps()
    enlarged = moderngl.NEAREST if sampler.nearest else moderngl.LINEAR
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, enlarged)
    # OpenGL mirrors by itself, but moderngl does not ask it to.
    texture.repeat_x, texture.repeat_y = (wrap == "repeat" for wrap in sampler.wrap)
    return texture
