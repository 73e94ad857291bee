"""Interface between the renderer and relighting methods.

The renderer prepares the scene and draws the G-buffer. The method turns them into signals, which
the renderer composites. Sparse tracing masks and the filter (`iprt.filter`) are services that a
method may use.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.compositing.object_layer import VisibleSurfaces
from iprt.compositing.real_layer import RealLayer
from iprt.device.compute import ComputeDevice
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.passes import Pass
from iprt.settings.features import Features
from iprt.world.world import World

Image = NDArray[np.float32]


@dataclass(frozen=True)
class GBuffer:
    """G-buffer of the view, as planes.

    Attributes
    ----------
    real : RealLayer
        Real surfaces, without the objects.
    objects : VisibleSurfaces
        Nearest surfaces of the objects.
    """

    real: RealLayer
    objects: VisibleSurfaces


@dataclass(frozen=True)
class Setup:
    """Setup of a method: one view of a scene on a device.

    Attributes
    ----------
    device : ComputeDevice
    view : View
        Later views differ in direction only.
    layout : PlaneLayout
        Shape of the view's planes.
    features : Features
        Features that the scene and the settings require.
    gbuffer : GBuffer
        The renderer's G-buffer, filled before the method's passes run.
    camera : (12,) float32 or None
        `CameraMotion.rows`, where the 360° camera moves.
    """

    device: ComputeDevice
    view: View
    layout: PlaneLayout
    features: Features
    gbuffer: GBuffer
    camera: cla.Array | None

    @property
    def equirect(self) -> bool:
        """True if the view shows the whole panorama."""
        return self.view.projection == "equirect"


@dataclass(frozen=True)
class Signals:
    """Denoised components of the picture, in buffers of the method.

    Attributes
    ----------
    ratio : (H * W, 4) float32 or None
        E_RV / E_R per color channel of each pixel, row by row (IPRT, Eq. 2): the factor of a real
        surface's radiance. Needed where `Needs.relit` is set.
    change : 3 planes or None
        Radiance that objects add to reflections of glossy real surfaces, of either sign. Needed
        where `Features.gloss` is set.
    diffuse : 3 planes or None
        Irradiance / π of objects, to be multiplied by their albedo. Needed where
        `Features.diffuse_signal` is set.
    specular : 3 planes or None
        Radiance that objects reflect specularly. Needed where `Features.specular_signal` is set.
    """

    ratio: cla.Array | None = None
    change: cla.Array | None = None
    diffuse: cla.Array | None = None
    specular: cla.Array | None = None


class Method(ABC):
    """Relighting method, built for one view.

    `iprt.settings.methods.MethodInfo` names the class and the data that it needs, which the
    renderer prepares first.

    Attributes
    ----------
    setup : Setup
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup

    @abstractmethod
    def passes(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes that light the pixels of `setup.gbuffer`, in order; called once.

        Parameters
        ----------
        world : World
            Real surfaces and objects, as kernel arguments.
        """

    @property
    @abstractmethod
    def signals(self) -> Signals:
        """Signals of the last frame."""

    def aov(self, name: str) -> Image | None:
        """Return an auxiliary picture of `iprt.aovs.AOVS`, (H, W) or (H, W, 3); None: no such one.

        Called after a frame.
        """
        return None

    @property
    def traced_count(self) -> cla.Array | None:
        """(1,) int32: traced pixels of real surfaces; None for a method without such pixels."""
        return None

    def read(self, planes: cla.Array | None, channels: slice) -> Image | None:
        """Read planes of a buffer to the host: (H, W) for one channel, else (H, W, C)."""
        if planes is None:
            return None
        return self.setup.layout.image(self.setup.device.read(planes), channels)


def in_front(coverage: Image | None, virtual: Image | None, real: Image | None) -> Image | None:
    """Return `virtual` where objects cover more than half of the pixel, else `real`.

    A missing `real` counts as 0; without `virtual` or `coverage`, `real` is returned.
    """
    if virtual is None or coverage is None:
        return real
    front = coverage > 0.5
    behind = np.zeros_like(virtual) if real is None else real
    return np.where(front if virtual.ndim == 2 else front[..., None], virtual, behind)
