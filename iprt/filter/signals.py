"""Signals to filter, each of one layer's pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from iprt.device.kernel_source import constant
from iprt.device.program import Define
from iprt.gbuffer.guide import Guide

REAL_PLANES = constant("lib/filter/signal.h", "REAL_PLANES")
REFLECTED_PLANES = constant("lib/filter/signal.h", "REFLECTED_PLANES")

Kind = Literal["ratio", "delta", "diffuse", "specular"]
"""Kind of a signal. For real surfaces, by estimator: E_R rgb and E_RV rgb; or blocked / E_R rgb and
bounce / E_R rgb. For objects: irradiance or radiance."""


@dataclass(frozen=True)
class Signal:
    """Signal of a batch: one of real surfaces, or several reflected ones, specular ones first.

    Attributes
    ----------
    name : str
        Prefix of its buffers.
    kind : Kind
    guide : Guide
        Features by which its pixels are compared.
    signed : bool
        Its values are changes of either sign.
    """

    name: str
    kind: Kind
    guide: Guide
    signed: bool = False


def signal_planes(kind: Kind) -> int:
    """Return the number of planes of a signal."""
    return REAL_PLANES if kind in ("ratio", "delta") else REFLECTED_PLANES


def half_unit(kind: Kind, radiance: float) -> float:
    """Return the factor, a power of two, of a signal in planes of half precision.

    Parameters
    ----------
    kind : Kind
        "ratio" is never stored in half precision.
    radiance : float
        Mean of the panorama, which becomes 1/8 to 1/4. A disc of the sun's size that sends all of
        its light stays below 65504, and precision is 11 bits down to a 2000th of the mean.
    """
    if kind == "delta" or not radiance > 0.0:
        return 1.0
    return 2.0 ** (-2 - math.frexp(radiance)[1])


def signal_defines(signals: Sequence[Signal]) -> dict[str, Define]:
    """Return the build flags of kernels for a batch of signals."""
    first = signals[0]
    return first.guide.defines(COMMON=first.kind == "ratio")
