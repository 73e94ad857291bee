"""Which axes poses are of, and which way they lead: told by whether frames agree about surfaces."""

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
"""Pairs of frames at most so far apart that are compared, each frame with all others."""
ENOUGH = 300
"""With fewer cells in sight of two frames, nothing is told."""
FEW = 0.02
"""A convention by which frames share less, relative to the one by which they share most, gains
nothing from the little that agrees."""
CLEARLY = 0.05
"""The layout's convention is given up for one of which more depths agree, by this share of all,
and of which at most MUCH of the disagreeing ones are left."""
MUCH = 0.6
AGREEING = 0.5
"""Where fewer depths agree by any convention, the poses are not those of the pictures."""
SAME_TURN = 1e-3
"""Tolerance of a first pose that is the origin."""

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
    """A convention, and in words how it was chosen."""

    convention: Convention
    words: str


def world_from_camera(poses: Matrix, convention: Convention) -> Matrix:
    """Return (N, 4, 4) poses of a convention as world from camera, in OpenCV's axes."""
    forward = np.asarray(np.linalg.inv(poses) if convention.endswith("-from-world") else poses)
    return forward @ _FLIP if convention.startswith("opengl") else forward


def sample(count: int) -> list[int]:
    """Return the numbers of the frames to compare, of so many."""
    apart = min(max(1, count // (2 * PAIRS)), APART)
    first = {int(at) for at in np.linspace(0, max(count - 1 - apart, 0), min(count, PAIRS))}
    return sorted(first | {min(at + apart, count - 1) for at in first})


def settle(source: str, glances: Sequence[Glance], poses: Matrix, guess: Convention) -> Settled:
    """Choose the convention by which what frames saw agrees.

    Parameters
    ----------
    source : str
        Names the sequence in errors.
    poses : (N, 4, 4) float64
        As stored, of the frames that the glances are of.
    guess : str
        The layout's convention: it stays unless another one is clearly better.

    Raises
    ------
    FormatError
        Frames overlap, but agree by none.
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
    """Count cells that agree, and these with those seen through; hidden ones tell nothing."""
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

    A first pose at the origin is the world's own camera, as SLAM systems have it. Else it is the
    layout's; without one, that nearest to the mean of what is up in the pictures.

    Parameters
    ----------
    poses : (N, 4, 4) float64
        As stored.
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
