"""Real scene on a device: everything that depends on the video alone, not on a view."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.footage.cut_detection import SWITCHED, is_cut
from iprt.footage.frame import Frame
from iprt.geometry.pose import camera_motion
from iprt.settings.features import Features
from iprt.world.real.background import OTHER_LIGHT
from iprt.world.real.camera_motion import STILL
from iprt.world.real.color_map import ColorMap
from iprt.world.real.highlight import Highlight
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.real.lights import Lights
from iprt.world.real.panorama import Panorama


class RealWorld:
    """Current frame of a video, prepared for rays. It is independent of views.

    Parameters
    ----------
    device : ComputeDevice
    frame : Frame
        The first frame.
    features : Features

    Attributes
    ----------
    frame : Frame
    version : int
        Number of frames loaded. A view compares it with its last picture's.
    cut_version : int
        The version since which the video shows one scene under one light. Accumulated state
        from before is invalid.
    panorama : Panorama
    lights : Lights or None
    irradiance : IrradianceCache or None
    highlight : Highlight or None
    """

    def __init__(self, device: ComputeDevice, frame: Frame, features: Features) -> None:
        self._features = features
        self.frame, self._complete = frame, False
        self.version = self.cut_version = self._split_version = 0
        self.panorama = Panorama(
            device,
            frame.width,
            frame.height,
            outside=features.opening_environment,
            gloss=features.gloss,
            color_map=features.color_map,
            share=not (features.video or features.color_map),
            background=features.settings.trace if features.background else None,
        )
        self._color_map = ColorMap(device) if features.color_map else None
        self.lights = Lights(device, frame.width, frame.height) if features.light_sampling else None
        self.irradiance = (
            IrradianceCache(device, self.panorama, features) if features.delta else None
        )
        self.highlight = Highlight(device, self.panorama, features) if features.gloss else None
        self._load(frame)

    @property
    def color_map(self) -> cla.Array | None:
        """`ColorMap.rows` of the frame."""
        return None if self._color_map is None else self._color_map.rows

    def load(self, frame: Frame) -> None:
        """Load another frame of the video, of the same size and with the same openings.

        Does nothing for the current frame: another view has loaded it.

        Raises
        ------
        ValueError
            Only one of it and the previous frame has a pose.
        """
        if frame is not self.frame or not self._complete:
            self._load(frame)

    def _load(self, frame: Frame) -> None:
        features, before = self._features, self.frame
        motion = camera_motion(before.pose, frame.pose)
        # After an abandoned update, accumulated state is invalid.
        abandoned, self._complete = not self._complete and self.version > 0, False
        mapped = features.objects and frame.color_map is not None
        assert features.color_map or not mapped, "no buffer for it"
        self.panorama.load(frame)
        if self._color_map is not None:
            self._color_map.load(frame.color_map)
        self.version += 1
        if features.objects:
            changed = self.panorama.flux.change
            cut = abandoned or is_cut(before, frame, changed)
            if cut or changed > SWITCHED:
                self.cut_version = self.version
            elsewhere = cut or not np.array_equal(motion, STILL)
            self.panorama.remember(forget=elsewhere or changed > OTHER_LIGHT)
            if self.lights is not None:
                self.lights.load(self.panorama.radiance, self.panorama.hidden_light)
            if self.irradiance is not None:
                self.irradiance.place(self.panorama, motion, changed=changed, cut=cut)
        self.frame, self._complete = frame, True

    def split_highlights(self) -> None:
        """Separate highlights from the panorama before its first use, where surfaces are glossy."""
        if self.highlight is None or self._split_version == self.version:
            return
        self.highlight.run()
        self._split_version = self.version
