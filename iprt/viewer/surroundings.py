"""The video around a turned picture, until the next one is ready."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skimage.transform import downscale_local_mean

from iprt.geometry.camera import View
from iprt.geometry.pose import view_from
from iprt.output.display import Bytes
from iprt.viewer.engine import Engine
from iprt.viewer.lens import Lens
from iprt.viewer.plain_video import PlainFrame

MOST_COLUMNS = 2048
"""Largest width: it is only seen in motion."""
AGAIN_S = 1.0
"""Least time in seconds between two, so that a playing video does not wait for them."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The panorama of a video frame.

    Attributes
    ----------
    pixels : (H, W, 3) uint8
    pose : (4, 4) float64 or None
        As in `Frame`.
    """

    pixels: Bytes
    pose: NDArray[np.float64] | None

    def axes(self, view: View) -> NDArray[np.float64]:
        """Return the (3, 3) rotation from a view's axes to the panorama's."""
        return view_from(view, self.pose).world_from_view


class SurroundingsDeveloper:
    """Development of the surroundings, for use by one thread at a time.

    Parameters
    ----------
    engine : Engine
    clock : callable
        Returns seconds.
    """

    def __init__(self, engine: Engine, clock: Callable[[], float] = time.monotonic) -> None:
        self._engine, self._clock = engine, clock
        self._small: tuple[PlainFrame, NDArray[np.float32]] | None = None
        self._made_of: tuple[object, ...] = ()
        self._made_s = -AGAIN_S
        self._newest: Surroundings | None = None

    def newest(self, lens: Lens) -> Surroundings | None:
        """Return the surroundings in a lens, the same object if nothing is new."""
        frame, exposure = self._engine.plain_frame, self._engine.scene.exposure
        made_of = frame, exposure, lens.exposure_ev, lens.curve
        if frame is None or made_of == self._made_of or self._clock() < self._made_s + AGAIN_S:
            return self._newest
        if self._small is None or self._small[0] is not frame:
            step = -(-frame.color.shape[1] // MOST_COLUMNS)
            small = downscale_local_mean(frame.color, (step, step, 1)).astype(np.float32)
            self._small = frame, small
        self._newest = Surroundings(lens.develop(self._small[1], exposure), frame.pose)
        self._made_of, self._made_s = made_of, self._clock()
        return self._newest
