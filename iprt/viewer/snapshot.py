"""Snapshots of a window's picture, for comparison with later states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.renderer import RenderedFrame
from iprt.viewer.session import Shown
from iprt.viewer.state import Request, World


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A picture with the state that it shows.

    Attributes
    ----------
    picture : RenderedFrame
    request : Request
    frame : int
        Number of the video frame.
    world : World
        Settings and edits.
    """

    picture: RenderedFrame
    request: Request
    frame: int
    world: World

    def radiance(self, shown: Shown) -> NDArray[np.float32] | str:
        """Return linear radiance (H, W, 3) of the same view, or the reason why there is none."""
        if shown.frame != self.frame:
            return f"the snapshot shows frame {self.frame}"
        ours, other = self.request.view, shown.request.view
        if ours.resized(other.width, other.height) != other:
            return "the snapshot shows another view"
        if ours != other:
            return "the snapshot has another size; they are compared at rest"
        return self.picture.color
