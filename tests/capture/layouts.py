"""Sequences of the analytic room in the layouts that other programs write."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from iprt.files.images import srgb_encode
from tests.capture.sequences import Z_UP, Array, Camera, Trace, looking_around, room
from tests.scene.files import write_png16_grey

CAMERA = Camera(64, 48, 44.0)
POSES = looking_around(12, (0.0,))
Y_DOWN = np.diag([1.0, -1.0, -1.0])
"""Turn from +Y up to the world of a first camera that looks level."""
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""Transform between OpenCV's and OpenGL's camera axes."""


def in_world(turn: Array, pose: Array) -> Array:
    """Return a pose (4, 4) in a turned world."""
    turned = np.eye(4)
    turned[:3] = turn @ pose[:3]
    return turned


def write_color(path: Path, camera: Camera, pose: Array, trace: Trace = room) -> None:
    color, _ = trace(pose[:3, 3], camera.rays() @ pose[:3, :3].T)
    coded = np.rint(255.0 * srgb_encode(np.clip(color, 0.0, 1.0))).astype(np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(coded).save(path, **({"quality": 98} if path.suffix == ".jpg" else {}))


def write_depth(path: Path, camera: Camera, pose: Array, trace: Trace = room) -> None:
    """Write depth in millimetres."""
    _, depth = trace(pose[:3, 3], camera.rays() @ pose[:3, :3].T)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png16_grey(path, np.rint(1000.0 * depth).astype(np.uint16))


def matrix_text(matrix: Array) -> str:
    return "\n".join(" ".join(f"{value:.9f}" for value in row) for row in matrix) + "\n"


def write_7_scenes(folder: Path) -> Path:
    """Write a pose file beside each picture, and the intrinsics of 3DMatch."""
    for number, pose in enumerate(POSES):
        name = f"frame-{number:06d}"
        write_color(folder / f"{name}.color.png", CAMERA, pose)
        write_depth(folder / f"{name}.depth.png", CAMERA, pose)
        (folder / f"{name}.pose.txt").write_text(matrix_text(in_world(Y_DOWN, pose)))
    (folder / "camera-intrinsics.txt").write_text(matrix_text(intrinsics(CAMERA)[:3, :3]))
    return folder


def intrinsics(camera: Camera) -> Array:
    """Return intrinsics (4, 4) as in ScanNet."""
    matrix = np.eye(4)
    matrix[0, 0] = matrix[1, 1] = camera.focal
    matrix[:2, 2] = camera.width / 2 - 0.5, camera.height / 2 - 0.5
    return matrix


def write_scannet(folder: Path) -> Path:
    """Write folders; color is larger than depth, of another aspect and focal length."""
    large = Camera(130, 96, 90.0)
    for number, pose in enumerate(POSES):
        write_color(folder / f"color/{number}.jpg", large, pose)
        write_depth(folder / f"depth/{number}.png", CAMERA, pose)
        (folder / "pose").mkdir(exist_ok=True)
        (folder / f"pose/{number}.txt").write_text(matrix_text(in_world(Z_UP, pose)))
    (folder / "intrinsic").mkdir()
    (folder / "intrinsic/intrinsic_color.txt").write_text(matrix_text(intrinsics(large)))
    (folder / "intrinsic/intrinsic_depth.txt").write_text(matrix_text(intrinsics(CAMERA)))
    return folder


def write_open3d(folder: Path) -> Path:
    """Write a trajectory log; pictures are numbered from 1, like Redwood's."""
    log = ""
    for number, pose in enumerate(POSES):
        write_color(folder / f"image/{number + 1:06d}-{33 * number:012d}.png", CAMERA, pose)
        write_depth(folder / f"depth/{number + 1:06d}-{33 * number + 9:012d}.png", CAMERA, pose)
        log += f"{number} {number} {number + 1}\n{matrix_text(in_world(Y_DOWN, pose))}"
    (folder / "trajectory.log").write_text(log)
    matrix = intrinsics(CAMERA)[:3, :3].T.ravel().tolist()
    sizes = {"width": CAMERA.width, "height": CAMERA.height}
    (folder / "intrinsic.json").write_text(json.dumps({**sizes, "intrinsic_matrix": matrix}))
    return folder


def write_nerfstudio(folder: Path) -> Path:
    frames = []
    for number, pose in enumerate(POSES):
        write_color(folder / f"images/frame_{number:05d}.png", CAMERA, pose)
        write_depth(folder / f"depth/frame_{number:05d}.png", CAMERA, pose)
        # Some programs leave the suffix out.
        name = f"images/frame_{number:05d}" + (".png" if number % 2 else "")
        matrix = (in_world(Z_UP, pose) @ FLIP).tolist()
        files = {"file_path": name, "depth_file_path": f"depth/frame_{number:05d}.png"}
        frames.append({**files, "transform_matrix": matrix})
    center = {"cx": CAMERA.width / 2, "cy": CAMERA.height / 2}
    size = {"w": CAMERA.width, "h": CAMERA.height, "fl_x": CAMERA.focal, "fl_y": CAMERA.focal}
    text = json.dumps({"camera_model": "OPENCV", **size, **center, "frames": frames})
    (folder / "transforms.json").write_text(text)
    return folder


def written(name: str, content: str | bytes) -> Callable[[Path], object]:
    data = content if isinstance(content, bytes) else content.encode()
    return lambda folder: (folder / name).write_bytes(data)


WRITERS: dict[str, Callable[[Path], Path]] = {
    "7-Scenes": write_7_scenes,
    "ScanNet": write_scannet,
    "Open3D": write_open3d,
    "nerfstudio": write_nerfstudio,
}
