"""Textures of materials and maps of their variants, as rays read them."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from iprt.device.kernel_source import constant
from iprt.geometry.material import Material, first_variants, table_rows
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.place import Place
from iprt.geometry.sampler import Sampler
from iprt.world.objects.mip_levels import color_levels, finish_levels, normal_levels

_HEADER, _OBJECTS = "lib/world/objects/textures.h", "lib/world/objects/objects_bvh.h"
_WRAP, _NEAREST = constant(_HEADER, "TEXTURE_WRAP"), constant(_HEADER, "TEXTURE_NEAREST")
_WRAPS = {
    "repeat": 0,
    "clamp": constant(_HEADER, "WRAP_CLAMP"),
    "mirror": constant(_HEADER, "WRAP_MIRROR"),
}


_LEVELS: tuple[Callable[[NDArray[np.float32], Material], list[NDArray[np.float32]]], ...] = (
    lambda image, material: color_levels(image, material.opacity_texture),
    lambda image, _: finish_levels(image),
    lambda image, _: normal_levels(image),
    lambda image, _: color_levels(image),
    lambda image, _: normal_levels(image),
)
"""Mip levels of the images of `Material.maps`."""
_ROWS = (1, 3, constant(_OBJECTS, "NORMAL_MAP_ROW"), 7, constant(_OBJECTS, "COAT_MAP_ROW"))
"""Rows of a material of the same images."""

_KEPT: dict[
    tuple[int, ...], tuple[list[weakref.ref[NDArray[np.float32]]], NDArray[np.float16]]
] = {}
"""Texels of the levels of images by their identities, for as long as these exist."""


def texture_table(
    materials: Sequence[Material],
) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """Return `BvhArgs.albedos`, and the (T, 4) texels of all textures."""
    needs = MaterialNeeds.of(materials)
    every = table_rows(materials)
    rows = 8 if needs.emission else 6 if needs.normal_maps else 4 if needs.principled else 2
    table = np.zeros((max(len(every), 1), rows, 4), np.float32)
    texels: list[NDArray[np.float16]] = []
    firsts: dict[int, int] = {}
    numbers = {place: number for number, place in enumerate(_places(materials), 1)}
    for row, material in zip(table, every, strict=False):
        row[0] = *material.albedo, material.opacity
        row[1, 3] = material.cutoff
        row[2:3, :2] = material.metallic, material.alpha
        row[6:7, :3] = material.emission
        maps = zip(_ROWS, material.maps, material.samplers, material.map_places, strict=True)
        for number, (at, image, sampler, place) in enumerate(maps):
            if image is None:
                continue
            levels = _levels(image, number, material)
            if id(levels) not in firsts:
                firsts[id(levels)] = sum(map(len, texels))
                texels.append(levels)
            row[at].view(np.uint32)[:3] = _packed(firsts[id(levels)], image.shape, sampler)
            if place is not None:
                row[at].view(np.uint32)[3] = numbers[place]
    if not texels:
        texels.append(np.zeros((1, 4), np.float16))
    return table.reshape(-1, 4), np.concatenate(texels)


def place_table(materials: Sequence[Material]) -> NDArray[np.float32]:
    """Return `BvhArgs.places`."""
    rows = []
    for place in _places(materials):
        first, second = place.matrix
        rows += [(*first, float(place.second)), (*second, place.scale)]
    return np.array(rows, np.float32).reshape(-1, 4)


def _places(materials: Sequence[Material]) -> list[Place]:
    """Return the places of maps of materials, each once."""
    every = (place for material in materials for place in material.map_places)
    return list(dict.fromkeys(place for place in every if place is not None))


def variant_table(
    materials: Sequence[Material],
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return `BvhArgs.variants` and `BvhArgs.indices`."""
    table = np.zeros((max(len(materials), 1), 4), np.int32)
    maps: list[NDArray[np.uint8]] = []
    for row, material, first in zip(table, materials, first_variants(materials), strict=False):
        if material.palette and (variants := material.variants) is not None:
            place = sum(map(len, maps))
            row.view(np.uint32)[:3] = _packed(place, variants.index.shape, variants.sampler)
            row[3] = first
            maps.append(variants.index.ravel())
    return table, np.concatenate(maps or [np.zeros(1, np.uint8)])


def _packed(place: int, shape: tuple[int, ...], sampler: Sampler) -> tuple[int, int, int]:
    """Return an image as `textures.h` has it; `place` is its first texel's."""
    wraps = [_WRAPS[wrap] << 2 * axis for axis, wrap in enumerate(sampler.wrap)]
    return place | sum(wraps) << _WRAP, shape[1] | sampler.nearest << _NEAREST, shape[0]


def _levels(image: NDArray[np.float32], number: int, material: Material) -> NDArray[np.float16]:
    """Return the texels (T, 4) of the levels of map `number` of a material.

    They are made once for each image.
    """
    opacity = material.opacity_texture if number == 0 else None
    used = [one for one in (image, opacity) if one is not None]
    key = (number, *map(id, used))
    if key not in _KEPT:
        levels = _LEVELS[number](image, material)
        texels = np.concatenate([level.astype(np.float16).reshape(-1, 4) for level in levels])
        _KEPT[key] = [weakref.ref(one, lambda _: _KEPT.pop(key, None)) for one in used], texels
    return _KEPT[key][1]
