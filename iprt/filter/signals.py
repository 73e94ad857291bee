"""Signals to be filtered, of one layer's pixels each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from iprt.device.program import Define
from iprt.files.kernel_source import constant
from iprt.gbuffer.guide import Guide

REAL_PLANES = constant("lib/filter/signal.h", "REAL_PLANES")
REFLECTED_PLANES = constant("lib/filter/signal.h", "REFLECTED_PLANES")

Kind = Literal["ratio", "delta", "diffuse", "specular"]
"""Kind of a signal. For real surfaces, by estimator: E_R rgb and E_RV rgb; or blocked / E_R rgb and
bounce / E_R rgb. For objects: irradiance or radiance."""


@dataclass(frozen=True)
class Signal:
    """One signal of a batch: one of real surfaces, or several reflected ones, specular ones first.

    Attributes
    ----------
    name : str
        Tells buffers apart.
    kind : Kind
    guide : Guide
        What its pixels are compared by.
    """

    name: str
    kind: Kind
    guide: Guide


def signal_planes(kind: Kind) -> int:
    """Number of planes of a signal."""
    return REAL_PLANES if kind in ("ratio", "delta") else REFLECTED_PLANES


def half_unit(kind: Kind, radiance: float) -> float:
    """What a signal is multiplied by in planes of half precision, a power of two.

    Parameters
    ----------
    kind : Kind
        "ratio" is not stored so.
    radiance : float
        Mean of the panorama, which becomes 1/8 to 1/4. A disc of the sun's size that sends all of
        its light stays below 65504, and precision is 11 bits down to a 2000th of the mean.
    """
    if kind == "delta" or not radiance > 0.0:
        return 1.0
    return 2.0 ** (-2 - math.frexp(radiance)[1])


def signal_defines(signals: Sequence[Signal]) -> dict[str, Define]:
    """Build flags of kernels that work on a batch of signals."""
    first = signals[0]
    return first.guide.defines(COMMON=first.kind == "ratio")
