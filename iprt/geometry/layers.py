"""Clear coats, sheen, specular reflection and transmission that vary over a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.reflectance import NEARLY, color_of
from iprt.geometry.sampler import Sampler
from iprt.geometry.variants import Float, Variants, grouped

Index = Callable[[Float], float]
ROUGHNESSES = 16
"""Steps of the roughness of layers with more values than that: tables of each take long to make."""
STRENGTHS, FEWER_STRENGTHS = 16, 4
"""Steps of the specular strength, without and with a map of roughness, which takes more tables."""
VARYING = (
    "clearcoat",
    "clearcoat_alpha",
    "sheen",
    "sheen_alpha",
    "ior",
    "tint",
    "transmission",
)
"""Attributes of `Material` that may vary."""


@dataclass(frozen=True)
class Layers:
    """The values at the distinct texels of a material's maps: one row without maps.

    Attributes
    ----------
    clearcoat, clearcoat_alpha : (N,) float64
    sheen : (N, 3) float64
    sheen_alpha : (N,) float64
    specular : (N, 3) float64
        Factor of the reflectance of a dielectric at normal incidence.
    transmission : (N,) float64
    weights : (N,) float64
        Numbers of texels.
    number : (H, W) int64
        Row of each texel.
    """

    clearcoat: Float
    clearcoat_alpha: Float
    sheen: Float
    sheen_alpha: Float
    specular: Float
    transmission: Float
    weights: Float
    number: NDArray[np.int64]

    @property
    def vary(self) -> bool:
        """True with a map of several values."""
        return len(self.weights) > 1

    @cached_property
    def mean(self) -> Layers:
        """The means over the maps, as one row."""
        return self.means(np.zeros(len(self.weights), np.int64))

    def means(self, group: NDArray[np.int64]) -> Layers:
        """Return the means of groups (N,) of rows, a row each."""
        total = np.asarray(np.bincount(group, self.weights), np.float64)

        def of(values: Float) -> Float:
            columns = np.atleast_2d(values.T) * self.weights
            sums = np.stack([np.bincount(group, column) / total for column in columns], axis=-1)
            return sums.reshape(len(total), *values.shape[1:])

        return Layers(
            of(self.clearcoat),
            of(self.clearcoat_alpha),
            of(self.sheen),
            of(self.sheen_alpha),
            of(self.specular),
            of(self.transmission),
            weights=total,
            number=group[self.number],
        )


def tint_of(specular: Float) -> tuple[float, float, float]:
    """Return the color of the reflection at normal incidence, whose greatest channel is 1."""
    most = float(specular.max())
    even = most - specular.min() <= NEARLY * most
    return (1.0, 1.0, 1.0) if even else color_of(specular / most)


def values_of(layers: Layers, row: int, index: Index) -> dict[str, Any]:
    """Return the attributes `VARYING` of a row of layers.

    `index` returns the index of refraction of a row of `Layers.specular`.
    """
    red, green, blue = color_of(layers.sheen[row])
    return {
        "clearcoat": float(layers.clearcoat[row]),
        "clearcoat_alpha": float(layers.clearcoat_alpha[row]),
        "sheen": (red, green, blue),
        "sheen_alpha": float(layers.sheen_alpha[row]),
        "ior": index(layers.specular[row]),
        "tint": tint_of(layers.specular[row]),
        "transmission": float(layers.transmission[row]),
    }


def variants_of(
    layers: Layers, index: Index, sampler: Sampler, *, tinted: bool, strengths: int = STRENGTHS
) -> Variants | None:
    """Return the map of layers that vary; None if nothing does.

    Parameters
    ----------
    index : callable
        As in `values_of`.
    sampler : Sampler
        Of the map.
    tinted : bool
        Use `Layers.specular`.
    strengths : int
        Most steps of the specular strength.
    """
    if not tinted:
        layers = replace(layers, specular=np.ones_like(layers.specular))
    if not layers.vary:
        return None
    # Steps of roots of alphas and of colors are more alike to the eye.
    similar = np.column_stack(
        [
            layers.clearcoat,
            np.sqrt(layers.clearcoat_alpha),
            np.sqrt(layers.sheen),
            np.sqrt(layers.sheen_alpha),
            np.sqrt(layers.specular),
            layers.transmission,
        ]
    )
    groups = _stepped(layers.means(grouped(similar, layers.weights)), strengths)
    entries = [values_of(groups, row, index) for row in range(len(groups.weights))]
    mean = values_of(layers.mean, 0, index)
    fixed = () if tinted else ("ior", "tint")
    names = tuple(
        name
        for name in VARYING
        if name not in fixed and not all(np.allclose(entry[name], mean[name]) for entry in entries)
    )
    if not names:
        return None
    rows = [tuple(entry[name] for name in names) for entry in entries]
    known = {row: number for number, row in enumerate(dict.fromkeys(rows))}
    place = np.array([known[row] for row in rows], np.uint8)
    return Variants(names, tuple(known), np.ascontiguousarray(place[groups.number]), sampler)


def _stepped(layers: Layers, strengths: int) -> Layers:
    """Return rows of layers whose roughnesses and specular strengths have few different values."""
    strength = layers.specular.max(axis=1)
    stepped = _few(strength, strengths, float(strength.max()))
    factor = np.where(strength > 0.0, stepped / np.maximum(strength, 1e-9), 1.0)
    return replace(
        layers,
        clearcoat_alpha=_few(np.sqrt(layers.clearcoat_alpha), ROUGHNESSES, 1.0) ** 2,
        sheen_alpha=_few(np.sqrt(layers.sheen_alpha), ROUGHNESSES, 1.0) ** 2,
        specular=layers.specular * factor[:, None],
    )


def _few(values: Float, most: int, greatest: float) -> Float:
    """Return values (N,) in [0, greatest], rounded to `most` steps if they are more."""
    if len(np.unique(values)) <= most + 1:
        return values
    step = max(greatest, 1e-9) / most
    return np.asarray(step * np.rint(values / step))
