"""Creation of a panorama, and of a 360° scene, from a sequence."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.capture.frame_gains import Exposures, match_exposures
from iprt.capture.gaps import fill, gaps
from iprt.capture.gathering import Gathering
from iprt.capture.rgbd_sequence import RgbdSequence
from iprt.capture.splat import splat
from iprt.errors import FormatError
from iprt.footage.video.depth_code import DepthCode
from iprt.geometry.equirect import solid_angles
from iprt.output.picture import write_exr
from iprt.scene.new_scene import new_scene

MEASURED, BETWEEN, UNSEEN = 1.0, 0.5, 0.0
"""Values of the layer `seen`: a sample was there; between samples; never seen, the color is made
up, and there is no depth."""


@dataclass(frozen=True)
class Captured:
    """The panorama of a sequence, with statistics.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance; unseen texels are filled from their surroundings.
    depth : (H, W) float32
        Metres from the centre; 0 for unseen texels.
    seen : (H, W) float32
        MEASURED, BETWEEN or UNSEEN.
    center : (3,) float64
        The panorama's centre in the world of the poses, rotated to +Y up.
    samples, removed, left_out : int
        Numbers of samples kept, of samples removed as seen through, and of frames whose colors do
        not match the others.
    matched : bool
        False if most frames did not match, so that all are used unchanged.
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
        """Share of the sphere's solid angle that is not UNSEEN."""
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
    """Accumulate the frames of a sequence, and render a panorama from a point.

    Parameters
    ----------
    width : int
        Width of the panorama in texels; even.
    center : (3,) float64 or None
        Centre in the world of the poses, rotated to +Y up. Default: the camera's mean position.
    every : int
        Use every n-th frame.
    compensate : bool
        Match the exposure and white balance of all frames to the first.
    progress : callable
        Called with the number of processed frames; each counts twice with `compensate`.

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
            f"{sequence.shots[0].depth}: no surface, neither here nor in later frames"
        )
    color, depth = splat(samples, width)
    measured = depth > 0.0
    between = gaps(measured)
    filled = fill(depth[..., None], measured)[..., 0]
    return Captured(
        np.where(measured[..., None], color, fill(color, measured)),
        np.where(measured, depth, np.where(between, filled, np.float32(0.0))),
        np.select([measured, between], [MEASURED, BETWEEN], UNSEEN).astype(np.float32),
        center,
        len(samples),
        gathering.removed,
        len(exposures.left_out),
        exposures.trusted,
        gathering.cloud.nbytes,
    )


def write_scene(folder: Path, captured: Captured) -> None:
    """Write a scene folder, completely or not at all; its `color.exr` has a layer `seen`.

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
