"""Hand-held sequences: an analytic room, a camera that looks around in it, and TUM's files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from iprt.files.images import srgb_encode
from tests.scene.files import write_png16_grey

Array = NDArray[np.float64]
STEP_M = 1.0 / 5000.0
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From +Y up to +Z up, the world of TUM's poses."""
WALLS = np.array([2.0, 1.3, 2.4])
"""Half the sides of the room, around the origin."""

Trace = Callable[[Array, Array], tuple[Array, Array]]
"""Rays' origin (3,) and directions (..., 3), of any length -> color (..., 3), and distance in
lengths of the direction."""


def room(origin: Array, direction: Array) -> tuple[Array, Array]:
    """A room of smooth colors."""
    with np.errstate(divide="ignore"):
        t = ((np.sign(direction) * WALLS - origin) / direction).min(axis=-1)
    return painted(origin + t[..., None] * direction), t


def painted(point: Array) -> Array:
    """The color of a point, from 0.1 to 0.7."""
    waves = np.stack([point @ [3.0, 1.0, 2.0], point @ [-1.0, 4.0, 1.0], point @ [1.0, 2.0, -3.0]])
    return np.moveaxis(0.4 + 0.3 * np.sin(waves), 0, -1)


def with_ball(center: Array, radius: float) -> Trace:
    """The room with a dark ball in it."""

    def trace(origin: Array, direction: Array) -> tuple[Array, Array]:
        color, t = room(origin, direction)
        a = (direction * direction).sum(axis=-1)
        b = direction @ (origin - center)
        root = b * b - a * ((origin - center) @ (origin - center) - radius * radius)
        near = (-b - np.sqrt(np.maximum(root, 0.0))) / a
        hit = (root > 0.0) & (near > 0.0) & (near < t)
        return np.where(hit[..., None], 0.02, color), np.where(hit, near, t)

    return trace


@dataclass(frozen=True)
class Camera:
    """A pinhole in OpenCV's convention."""

    width: int = 160
    height: int = 120
    focal: float = 110.0

    def rays(self) -> Array:
        """(H, W, 3), of z = 1."""
        y, x = np.indices((self.height, self.width))
        cx, cy = self.width / 2 - 0.5, self.height / 2 - 0.5
        ones = np.ones(x.shape)
        return np.stack([(x - cx) / self.focal, (y - cy) / self.focal, ones], axis=-1)

    def toml(self) -> str:
        cx, cy = self.width / 2 - 0.5, self.height / 2 - 0.5
        return f"fx = {self.focal}\nfy = {self.focal}\ncx = {cx}\ncy = {cy}\n"


def looking_around(yaws: int, pitches: tuple[float, ...], sway: float = 0.25) -> list[Array]:
    """(4, 4) poses, scene from camera, +Y up: all around, at some pitches, at arm's length."""
    poses = []
    for pitch in pitches:
        for yaw in np.arange(yaws) / yaws * 360.0:
            # From OpenCV's axes to ones that look along -Z, then up, then right.
            turn = Rotation.from_euler("YXZ", [-yaw, pitch, 0.0], degrees=True).as_matrix()
            pose = np.eye(4)
            pose[:3, :3] = turn @ np.diag([1.0, -1.0, -1.0])
            pose[:3, 3] = sway * -turn[:, 2] + [0.0, 0.05 * np.sin(np.deg2rad(2 * yaw)), 0.0]
            poses.append(pose)
    return poses


def write_tum(
    folder: Path,
    camera: Camera,
    poses: list[Array],
    shoot: Callable[[int, Array, Array], tuple[Array, Array]],
) -> Path:
    """Write a sequence; `shoot` has the number, the camera's position and its rays in the scene,
    and gives linear color and depth along the camera's +Z.
    """
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    lines: dict[str, list[str]] = {"rgb": ["# color"], "depth": ["# depth"], "groundtruth": []}
    for number, pose in enumerate(poses):
        color, depth = shoot(number, pose[:3, 3], camera.rays() @ pose[:3, :3].T)
        time = 1000.0 + number / 30.0
        # The three clocks differ, as those of a Kinect and of motion capture do.
        for name, at in (("rgb", time), ("depth", time + 0.006)):
            lines[name].append(f"{at:.6f} {name}/{number:04d}.png")
        coded = np.rint(255.0 * srgb_encode(np.clip(color, 0.0, 1.0))).astype(np.uint8)
        Image.fromarray(coded).save(folder / f"rgb/{number:04d}.png")
        steps = np.rint(np.nan_to_num(depth) / STEP_M)
        write_png16_grey(folder / f"depth/{number:04d}.png", steps.astype(np.uint16))
        position = Z_UP @ pose[:3, 3]
        quaternion = Rotation.from_matrix(Z_UP @ pose[:3, :3]).as_quat()
        words = " ".join(f"{value:.6f}" for value in [*position, *quaternion])
        lines["groundtruth"].append(f"{time - 0.004:.6f} {words}")
    for name, text in lines.items():
        (folder / f"{name}.txt").write_text("\n".join(text) + "\n")
    (folder / "camera.toml").write_text(camera.toml())
    return folder


def noisy(depth: Array, random: np.random.Generator) -> Array:
    """Depth as a structured-light sensor has it: noise that grows with its square, and holes."""
    measured = depth + 0.002 * depth**2 * random.standard_normal(depth.shape)
    blocks = random.random((depth.shape[0] // 8 + 1, depth.shape[1] // 8 + 1)) < 0.05
    missing = np.kron(blocks, np.ones((8, 8), bool))[: depth.shape[0], : depth.shape[1]]
    return np.where(missing | (depth > 8.0), 0.0, measured)
