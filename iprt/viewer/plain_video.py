"""The video in a view, without objects: the picture until there is a rendered one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.pose import view_from
from iprt.renderer import RenderedFrame
from iprt.scene.scene import Scene
from iprt.viewer.background_jobs import BackgroundJobs
from iprt.viewer.session import Shown
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import Request


@dataclass(frozen=True, eq=False)
class PlainFrame:
    """The color of a video frame.

    Attributes
    ----------
    source : Frame or (H, W, 3) float32
        Whole frame, or linear radiance.
    index : int
    pose : (4, 4) float64 or None
        As in `Frame`.
    """

    source: Frame | NDArray[np.float32]
    index: int
    pose: NDArray[np.float64] | None

    @classmethod
    def of(cls, frame: Frame) -> PlainFrame:
        """Return the color of a frame."""
        return cls(frame, frame.index, frame.pose)

    @cached_property
    def color(self) -> NDArray[np.float32]:
        """Linear radiance (H, W, 3)."""
        return self.source.picture if isinstance(self.source, Frame) else self.source

    @classmethod
    def read(cls, scene: Scene, index: int) -> PlainFrame:
        """Read the color of a scene's frame, which is quicker than reading the frame.

        Raises
        ------
        FormatError
            The color cannot be read.
        """
        with scene.raw_frames.reading() as reader:
            color, pose = reader.color(index), reader.pose(index)
        return cls(np.maximum(np.nan_to_num(color, posinf=0.0), np.float32(0.0)), index, pose)

    def seen(self, view: View) -> NDArray[np.float32]:
        """Resample the panorama to a view: (H, W, 3) linear radiance, bilinear."""
        height, width = self.color.shape[:2]
        pixels = equirect_pixel(view_from(view, self.pose).directions(), width, height) - 0.5
        places = [np.clip(pixels[..., 1], 0, height - 1), pixels[..., 0]]
        channels = [
            map_coordinates(self.color[..., channel], places, order=1, mode="grid-wrap")
            for channel in range(3)
        ]
        return np.stack(channels, axis=-1)


class PlainVideo:
    """The first frame, from when its color is read, and later the newest one.

    Parameters
    ----------
    shared : SharedState
    jobs : BackgroundJobs
    scene : Scene

    Attributes
    ----------
    frame : PlainFrame or None
        None before the first is read; readable from any thread.
    """

    def __init__(self, shared: SharedState, jobs: BackgroundJobs, scene: Scene) -> None:
        self._shared = shared
        self.frame: PlainFrame | None = None
        index = shared.world.playback.frame

        def read() -> Callable[[], None]:
            first = PlainFrame.read(scene, index)

            def finish() -> None:
                self.frame = self.frame or first

            return finish

        # The reader of the whole frame reports damage.
        jobs.start("reading the video", read, lambda _: None)

    def follow(self, frame: Frame) -> None:
        """Set the newest frame."""
        if self.frame is None or self.frame.source is not frame:
            self.frame = PlainFrame.of(frame)

    def show(self, client: int) -> None:
        """Publish the video in a client's view, unless the client has a picture of it already."""
        asked, shown = self._shared.snapshot.requests.get(client), self._shared.shown(client)
        plain = self.frame
        if plain is None or asked is None or (shown is not None and not shown.plain):
            return
        if shown is None or shown.request.view != asked.request.view:
            self._shared.publish(client, _picture(plain, asked.request))


def _picture(plain: PlainFrame, request: Request) -> Shown:
    """Build a picture that answers no request."""
    return Shown(
        number=-1,
        step=0,
        request=replace(request, aovs=()),
        frame=plain.index,
        picture=RenderedFrame(plain.seen(request.view), {}),
        pose=plain.pose,
        geometry=None,
        frames=0,
        noise=None,
        passes=(),
        seconds=0.0,
        device="",
        compiled=True,
        plain=True,
    )
