"""A 360° scene from a sequence."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.capture.exposure import Exposures, match_exposures
from iprt.capture.fill import fill, gaps
from iprt.capture.gathering import Gathering
from iprt.capture.sequence import RgbdSequence
from iprt.capture.splat import splat
from iprt.errors import FormatError
from iprt.footage.video.depth_code import DepthCode
from iprt.geometry.equirect import solid_angles
from iprt.output.exr import write_exr
from iprt.scene.edit import new_scene

MEASURED, BETWEEN, UNSEEN = 1.0, 0.5, 0.0
"""Values of the layer `seen`: a sample was there; between samples; never seen, the colour is made
up, and there is no depth.
"""


@dataclass(frozen=True)
class Captured:
    """A panorama of a sequence, and how it came about.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance; filled from around where nothing was seen.
    depth : (H, W) float32
        Metres from the centre; 0 where nothing was seen.
    seen : (H, W) float32
        MEASURED, BETWEEN or UNSEEN.
    center : (3,) float64
        The panorama's centre in the world of the poses, turned to +Y up.
    samples, removed, left_out : int
        Samples held, samples that were removed as seen through, and frames whose colours do not
        match those of the others.
    matched : bool
        False: most frames did not match, and all were taken as they are.
    cloud_bytes : int
        Memory of the cloud.
    """

    color: NDArray[np.float32]
    depth: NDArray[np.float32]
    seen: NDArray[np.float32]
    center: NDArray[np.float64]
    samples: int
    removed: int
    left_out: int
    matched: bool
    cloud_bytes: int

    @property
    def seen_share(self) -> float:
        """Share of the sphere that is not UNSEEN."""
        rows = (self.seen != UNSEEN).mean(axis=1)
        return float(np.average(rows, weights=solid_angles(*self.seen.shape[::-1])))


def capture_panorama(
    sequence: RgbdSequence,
    *,
    width: int,
    center: NDArray[np.float64] | None = None,
    every: int = 1,
    compensate: bool = True,
    progress: Callable[[int], None] = lambda done: None,
) -> Captured:
    """Gather the frames of a sequence and look at them from a point.

    Parameters
    ----------
    width : int
        Texels around; even.
    center : (3,) float64 or None
        In the world of the poses, turned to +Y up. Default: the mean position of the camera.
    every : int
        Use every n-th frame.
    compensate : bool
        Bring all frames to the colours of the first.
    progress : callable
        Is told the number of frames that are done; each counts twice if colours are matched.

    Raises
    ------
    FormatError
        A picture cannot be read, or none shows a surface.
    """
    if center is None:
        center = sequence.positions().mean(axis=0)
    indices = range(0, len(sequence.shots), every)
    poses = np.stack([sequence.pose(index, center) for index in indices])
    exposures = Exposures.as_they_are(len(indices))
    if compensate:
        glances = []
        for index in indices:
            glances.append(sequence.read(index).glance())
            progress(len(glances))
        exposures = match_exposures(glances, poses)
    gathering = Gathering()
    for number, index in enumerate(indices):
        picture = sequence.read(index)
        color = exposures.matched(number, picture.color, picture.camera)
        gathering.add(
            replace(picture, color=color), poses[number], shown=number not in exposures.left_out
        )
        progress(number + 1 + compensate * len(indices))
    samples = gathering.cloud.samples()
    if not len(samples):
        raise FormatError(
            f"{sequence.shots[0].depth}: no surface, neither here nor in what follows"
        )
    view = splat(samples, width)
    measured = view.depth > 0.0
    between = gaps(measured)
    color = np.where(measured[..., None], view.color, fill(view.color, measured))
    filled = fill(view.depth[..., None], measured)[..., 0]
    return Captured(
        color,
        np.where(measured, view.depth, np.where(between, filled, np.float32(0.0))),
        np.select([measured, between], [MEASURED, BETWEEN], UNSEEN).astype(np.float32),
        center,
        len(samples),
        gathering.removed,
        len(exposures.left_out),
        exposures.trusted,
        gathering.cloud.nbytes,
    )


def write_scene(folder: Path, captured: Captured) -> None:
    """Write a scene folder, whole or not at all.

    Its `color.exr` has a layer `seen`.

    Raises
    ------
    SceneError, FormatError
        The folder holds a scene already, or cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="iprt-") as place:
        color, depth = Path(place) / "color.exr", Path(place) / "depth.exr"
        write_exr(color, captured.color, aovs={"seen": captured.seen})
        _write_depth(depth, captured.depth)
        new_scene(folder, color, depth, DepthCode(), None)


def _write_depth(path: Path, depth: NDArray[np.float32]) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"Z": depth}) as file:
        file.write(str(path))
