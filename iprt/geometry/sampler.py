"""Reading of textures beyond their borders and between their texels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Wrap = Literal["repeat", "clamp", "mirror"]


@dataclass(frozen=True)
class Sampler:
    """Filter and wrap modes of a texture.

    Attributes
    ----------
    wrap : (Wrap, Wrap)
        Beyond 0 and 1, along u and v.
    nearest : bool
        The nearest texel, without interpolation.
    """

    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False


PLAIN = Sampler()
Samplers = tuple[Sampler, Sampler, Sampler, Sampler, Sampler]
"""Samplers of a material's maps."""
ALL_PLAIN: Samplers = (PLAIN, PLAIN, PLAIN, PLAIN, PLAIN)
