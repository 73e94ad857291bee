"""Conventions of camera poses: their axes and direction, chosen by how well frames agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from iprt.capture.found import Axis, Convention
from iprt.capture.overlap import Glance, overlap
from iprt.errors import FormatError

CONVENTIONS: tuple[Convention, ...] = get_args(Convention)
PAIRS, APART = 12, 10
"""Number of sampled pairs, and largest distance in frames within a pair. All sampled frames are
then compared with each other."""
ENOUGH = 300
"""Fewest cells seen by two frames that allow a decision."""
FEW = 0.02
"""Overlap, relative to the convention with the most, below which agreement counts for less."""
CLEARLY = 0.05
"""Gain in the share of agreeing depths that overrides the layout's convention. At most the fraction
MUCH of the disagreeing ones may remain."""
MUCH = 0.6
AGREEING = 0.5
"""Share of agreeing depths below which poses and pictures do not match."""
SAME_TURN = 1e-3
"""Tolerance for a first pose at the origin."""

Matrix = NDArray[np.float64]
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
WORDS = {
    "opencv": "camera to world, OpenCV's axes",
    "opengl": "camera to world, OpenGL's axes",
    "opencv-from-world": "world to camera, OpenCV's axes",
    "opengl-from-world": "world to camera, OpenGL's axes",
}


@dataclass(frozen=True)
class Settled:
    """A convention, and the reason for it in words."""

    convention: Convention
    words: str


def world_from_camera(poses: Matrix, convention: Convention) -> Matrix:
    """Return (N, 4, 4) poses of a convention as world from camera, in OpenCV's axes."""
    forward = np.asarray(np.linalg.inv(poses) if convention.endswith("-from-world") else poses)
    return forward @ _FLIP if convention.startswith("opengl") else forward


def sample(count: int) -> list[int]:
    """Return the indices of the frames to compare, out of `count`."""
    apart = min(max(1, count // (2 * PAIRS)), APART)
    first = {int(at) for at in np.linspace(0, max(count - 1 - apart, 0), min(count, PAIRS))}
    return sorted(first | {min(at + apart, count - 1) for at in first})


def settle(source: str, glances: Sequence[Glance], poses: Matrix, guess: Convention) -> Settled:
    """Choose the convention in which the depths of frames agree.

    Parameters
    ----------
    source : str
        Name of the sequence in errors.
    poses : (N, 4, 4) float64
        Stored poses of the glances' frames.
    guess : str
        The layout's convention, kept unless another one is clearly better.

    Raises
    ------
    FormatError
        Frames overlap, but agree in no convention.
    """
    counts = {name: _agreement(glances, world_from_camera(poses, name)) for name in CONVENTIONS}
    most = max(compared for _, compared in counts.values())
    shares = {name: agree / max(n, 1) for name, (agree, n) in counts.items()}
    worth = {name: agree / max(n, FEW * most, ENOUGH) for name, (agree, n) in counts.items()}
    best = max(CONVENTIONS, key=worth.__getitem__)
    if counts[guess][1] < ENOUGH:
        return Settled(guess, f"{WORDS[guess]} (not checked: frames share too little)")
    gain, left = worth[best] - shares[guess], 1.0 - worth[best]
    if worth[best] > AGREEING and gain > CLEARLY and left < MUCH * (1.0 - shares[guess]):
        return Settled(
            best,
            f"{WORDS[best]}: {shares[best]:.0%} of depths agree, but {shares[guess]:.0%} by "
            f"{WORDS[guess]}, as the layout has it",
        )
    if shares[guess] < AGREEING:
        listed = ", ".join(f"{name} {share:.0%}" for name, share in shares.items())
        raise FormatError(
            f"{source}: poses and depth agree by no convention ({listed} of depths); check the "
            "poses, depth_scale and the intrinsics, or give --poses"
        )
    return Settled(guess, f"{WORDS[guess]} ({shares[guess]:.0%} of depths agree)")


def _agreement(glances: Sequence[Glance], poses: Matrix) -> tuple[int, int]:
    """Count agreeing cells, and agreeing plus seen-through cells; hidden cells are undecided."""
    agree = through = 0
    for i, glance in enumerate(glances):
        for j, other in enumerate(glances):
            if i != j:
                both = overlap(glance, other, np.linalg.inv(poses[j]) @ poses[i])
                agree += int(both.agree.sum())
                through += both.seen_through
    return agree, agree + through


def up_axis(poses: Matrix, convention: Convention, layout: Axis | None) -> Axis:
    """Return the axis of the poses' world that points up.

    If the first pose is the origin, as in SLAM systems, it is that camera's up axis. Otherwise it
    is the layout's axis or, without one, the axis nearest to the mean up direction of the pictures.

    Parameters
    ----------
    poses : (N, 4, 4) float64
        Stored poses.
    layout : str or None
    """
    if np.abs(poses[0] - np.eye(4)).max() < SAME_TURN:
        return "y" if convention.startswith("opengl") else "-y"
    if layout is not None:
        return layout
    mean = -world_from_camera(poses, convention)[:, :3, 1].mean(axis=0)
    axis = int(np.argmax(np.abs(mean)))
    names: tuple[tuple[Axis, Axis], ...] = (("x", "-x"), ("y", "-y"), ("z", "-z"))
    return names[axis][int(mean[axis] < 0.0)]
