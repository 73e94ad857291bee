"""Temporal filter fed with images, and noisy signals for it."""

from __future__ import annotations

import numpy as np

from iprt.device.compute import ComputeDevice
from iprt.filter.signals import Kind, Signal, signal_planes
from iprt.filter.temporal import Accumulated, Temporal
from iprt.settings.filter import TemporalSettings
from tests.filter.gbuffer import GBuffer, read, still_motion, upload

SETTINGS = TemporalSettings()


class Session:
    """A temporal filter fed with images."""

    def __init__(
        self,
        device: ComputeDevice,
        gbuffer: GBuffer,
        kind: Kind,
        *,
        rays: int = 1,
        published: bool = False,
        signed: bool = False,
    ) -> None:
        self.device = device
        self.layout = gbuffer.layout
        self.planes = signal_planes(kind)
        self.guide = gbuffer.guide(device)
        signals = [Signal("test", kind, self.guide, signed)]
        self.temporal = Temporal(device, signals, SETTINGS, rays=rays, published=published)
        self.still = still_motion(self.layout.width, self.layout.height)

    def add(
        self,
        gbuffer: GBuffer,
        signal: np.ndarray,
        motion: np.ndarray | None = None,
        level: np.ndarray | None = None,
        *,
        fading: float = 0.0,
        changed: bool = False,
    ) -> Accumulated:
        gbuffer.fill(self.device, self.guide)
        levels = np.zeros(self.still.shape[1:]) if level is None else level
        (result,) = self.temporal.run(
            [upload(self.device, self.layout, signal)],
            [upload(self.device, self.layout, self.still if motion is None else motion)],
            [self.device.upload("level", self.layout.padded(levels[None].astype(np.uint8)))],
            fading=fading,
            changed=changed,
        )
        return result

    def image(self, planes: object) -> np.ndarray:
        """Return a plane, or the planes of a history's signal, as an image."""
        return read(self.device, self.layout, planes)[: self.planes]


def noise(rng: np.random.Generator, kind: Kind, width: int, height: int) -> np.ndarray:
    signal = rng.gamma(2.0, 0.5, (signal_planes(kind), height, width))
    if kind == "ratio":  # influence in part of the picture only
        shadow = rng.random((1, height, width)) < 0.3
        shadow[..., : width // 2] = False
        signal[3:] = np.where(shadow, 0.2, 1.0) * signal[:3]
    if kind == "delta":
        touched = rng.random((1, height, width)) < 0.3
        touched[..., : width // 2] = False
        signal = np.where(touched, signal, 0.0)
    return signal
