"""Real scene on a device: everything that depends on the video alone, not on a view."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.footage.cut_detection import SWITCHED, is_cut
from iprt.footage.frame import Frame
from iprt.geometry.pose import camera_motion
from iprt.passes import Clock, Pass, Schedule
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
    schedule, shown : Schedule
        Passes of a frame of the video, and the further ones if a view shows it. Frames that are
        only remembered do without.
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
        self.frame = frame
        self._still = not features.video  # and its surfaces still hold the input of a next frame
        self.cut_version = 0
        self.panorama = Panorama(
            device,
            frame.width,
            frame.height,
            outside=features.opening_environment,
            gloss=features.gloss,
            color_map=features.color_map,
            background=features.settings.trace if features.background else None,
        )
        self._color_map = ColorMap(device) if features.color_map else None
        self.lights = Lights(device, frame.width, frame.height) if features.light_sampling else None
        self.irradiance = (
            IrradianceCache(device, self.panorama, features) if features.delta else None
        )
        self.highlight = Highlight(device, self.panorama, features) if features.gloss else None
        self.schedule = Schedule(self._passes(), device.profile)
        self.shown = Schedule(self._shown_passes(), device.profile, self.schedule)
        self._load(frame)

    def _passes(self) -> list[Pass[Frame]]:
        """Return the passes of a frame of the video."""
        panorama, lights = self.panorama, self.lights
        passes = panorama.passes()
        if self._color_map is not None:
            passes.append(Pass("color map", Clock.VIDEO, self._map_colors, (), ("color map",)))
        if self._features.objects:
            light = ("flux", "radiance")
            passes.append(Pass("cuts", Clock.VIDEO, self._find_cut, light, ("cuts",)))
        if panorama.background is not None:
            seen = ("surfaces", "radiance", "cuts")
            passes.append(Pass("background", Clock.VIDEO, self._remember, seen, ("background",)))
        if lights is not None:
            passes.append(
                Pass(
                    "lights",
                    Clock.VIDEO,
                    lambda _: lights.load(panorama.radiance, panorama.hidden_light),
                    ("radiance", "background"),
                    ("lights",),
                )
            )
        if self.irradiance is not None:
            placed = ("surfaces", "flux", "cuts")
            passes.append(Pass("irradiance", Clock.VIDEO, self._place_cells, placed, ("cells",)))
        return passes

    def _shown_passes(self) -> list[Pass[Frame]]:
        """Return the passes of a frame that a view shows."""
        highlight = self.highlight
        if highlight is None:
            return []
        shiny, split = ("surfaces", "pyramid", "radiance", "gloss"), ("highlights", "radiated")
        return [Pass("highlights", Clock.VIDEO, lambda _: highlight.run(), shiny, split)]

    @property
    def version(self) -> int:
        """Number of frames loaded. A view compares it with its last picture's."""
        return self.schedule.versions[Clock.VIDEO]

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
        if frame is not self.frame or not self.schedule.complete:
            self._load(frame)

    def _load(self, frame: Frame) -> None:
        features = self._features
        mapped = features.objects and frame.color_map is not None
        assert features.color_map or not mapped, "no buffer for it"
        self._motion = camera_motion(self.frame.pose, frame.pose)
        # After an abandoned update, accumulated state is invalid.
        self._cut = not self.schedule.complete
        self.schedule.tick(Clock.VIDEO)
        self.schedule.walk(frame)
        self.frame = frame

    def prepare(self) -> None:
        """Run the passes of `shown`, before a view uses the frame."""
        self.shown.walk(self.frame)
        if self._still:
            self.panorama.surfaces.release()
            self._still = False

    def _map_colors(self, frame: Frame) -> None:
        assert self._color_map is not None
        self._color_map.load(frame.color_map)

    def _find_cut(self, frame: Frame) -> None:
        """Decide whether the frame continues the scene, and the light, of the previous one."""
        changed = self.panorama.flux.change
        self._cut |= is_cut(self.frame, frame, changed)
        if self._cut or changed > SWITCHED:
            self.cut_version = self.version

    def _remember(self, _: Frame) -> None:
        elsewhere = self._cut or not np.array_equal(self._motion, STILL)
        self.panorama.remember(forget=elsewhere or self.panorama.flux.change > OTHER_LIGHT)

    def _place_cells(self, _: Frame) -> None:
        assert self.irradiance is not None
        changed = self.panorama.flux.change
        self.irradiance.place(self.panorama, self._motion, changed=changed, cut=self._cut)
