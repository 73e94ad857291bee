"""A small video file of a room in which everything moves: real things, objects and the view."""

from __future__ import annotations

from pathlib import Path

from iprt.scene.scene import Scene
from scenes360.modelling import box, sphere, write_ply
from scenes360.video import write_color, write_depth
from tests.oracles.worlds import Box, World
from tests.worlds import ceiling_lamp, room_frame

FRAMES = 12

MANIFEST = """format = 1
name = "moving"

[video]
color = "color.mkv"
depth = "depth.mkv"
depth_scale = 1e-4

[[objects]]
name = "ball"
mesh = "ball.ply"
to_world = [1, 0, 0, -0.5, 0, 1, 0, -1.1, 0, 0, 1, -1.5, 0, 0, 0, 1]
material = { kind = "diffuse", albedo = [0.6, 0.3, 0.2] }
keyframes = [
  { time = 0.0, translation = [0, 0, 0] },
  { time = 0.5, translation = [0.8, 0.3, 0.2] },
  { time = 0.9, translation = [0.1, 0, 0] },
]

[[objects]]
name = "box"
mesh = "box.ply"
to_world = [1, 0, 0, 0.4, 0, 1, 0, -1.2, 0, 0, 1, -1.3, 0, 0, 0, 1]
material = { kind = "plastic", albedo = [0.2, 0.5, 0.8], alpha = 0.2 }
keyframes = [
  { time = 0.0, rotation = [0, 0, 0, 1] },
  { time = 0.9, rotation = [0, 0.8, 0, 0.6] },
]

[[views]]
name = "ahead"
pitch_deg = -35.0
fov_y_deg = 55.0
size = [128, 64]
keyframes = [
  { time = 0.0, yaw_deg = -10.0 },
  { time = 0.7, yaw_deg = 15.0, interpolation = "step" },
  { time = 0.8, yaw_deg = 60.0 },
]
"""


def write_moving(folder: Path, *, window: bool = False) -> Scene:
    """Write a room with a lamp in which a real box slides past, and objects and the view move.

    With a `window`, which has no depth, a part of the room receives no light of objects.
    """
    folder.mkdir(exist_ok=True)
    frames = []
    for index in range(FRAMES):
        solid = Box((-1.0 + 0.2 * index, -0.9, -1.7), (0.2, 0.3, 0.2))
        frame = room_frame(World(solids=(solid,)), 64, 32, ceiling_lamp)
        if window:
            frame.depth[12:20, 24:36] = 0.0
        frames.append(frame)
    write_color(folder / "color.mkv", (frame.color for frame in frames), fps=12.0, crf=4)
    write_depth(folder / "depth.mkv", (frame.depth for frame in frames), fps=12.0, scale=1e-4)
    write_ply(folder / "ball.ply", sphere(0.3, segments=24))
    write_ply(folder / "box.ply", box((0.4, 0.4, 0.3), bevel=0.02))
    (folder / "scene.toml").write_text(MANIFEST)
    return Scene.open(folder)
