"""Thumbnail of the panorama with directions, views and objects drawn in."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from iprt.files.atomic import replacing
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.mesh import transformed
from iprt.output.display import developed
from iprt.scene.scene import Scene

WIDTH, HEIGHT = 1024, 512
_AXES = ((0, "-Z"), (90, "+X"), (180, "+Z"), (-90, "-X"))
_AXIS_COLOR, _VIEW_COLOR, _OBJECT_COLOR = (255, 255, 255), (255, 220, 60), (90, 230, 255)


def write_thumbnail(path: Path, scene: Scene, frame: Frame) -> None:
    """Write a 1024 x 512 PNG: the displayed panorama, axes, outlines of views, objects.

    Raises
    ------
    FormatError
        The file cannot be written.
    """
    image = Image.fromarray(developed(frame.picture, scene.exposure)).resize((WIDTH, HEIGHT))
    draw = ImageDraw.Draw(image)
    draw.line([(0, HEIGHT // 2), (WIDTH, HEIGHT // 2)], fill=_AXIS_COLOR)
    for yaw, label in _AXES:
        x = (yaw / 360.0 + 0.5) * WIDTH % WIDTH
        draw.line([(x, HEIGHT // 2 - 8), (x, HEIGHT // 2 + 8)], fill=_AXIS_COLOR, width=2)
        _label(draw, (x + 4, HEIGHT // 2 + 4), label, _AXIS_COLOR)
    for entry in scene.views.values():
        pixels = equirect_pixel(_border(entry.view), WIDTH, HEIGHT)
        for start, end in pairwise(pixels):
            if abs(start[0] - end[0]) < WIDTH / 2:  # does not jump across the seam
                draw.line([tuple(start), tuple(end)], fill=_VIEW_COLOR, width=2)
        _label(draw, tuple(pixels[0] + (4, 2)), entry.name, _VIEW_COLOR)
    for instance in scene.instances:
        center = transformed(instance.to_world, instance.mesh.positions.mean(axis=0))
        x, y = equirect_pixel(center, WIDTH, HEIGHT)
        draw.ellipse([x - 4, y - 4, x + 4, y + 4], outline=_OBJECT_COLOR, width=2)
        _label(draw, (x + 6, y - 6), instance.name, _OBJECT_COLOR)
    with replacing(path) as temporary:
        image.save(temporary, format="PNG")


def _border(view: View) -> NDArray[np.float64]:
    """Return directions (N, 3) around the picture's edge, closed at the top left corner."""
    t = np.linspace(0.0, 1.0, 65)
    square = [(t, 0 * t), (0 * t + 1, t), (t[::-1], 0 * t + 1), (0 * t, t[::-1])]
    pixels = np.concatenate([np.stack(side, axis=-1) for side in square])
    return view.unproject(pixels * (view.width, view.height))


def _label(
    draw: ImageDraw.ImageDraw, at: tuple[float, ...], text: str, color: tuple[int, int, int]
) -> None:
    draw.text((at[0], at[1]), text, fill=color, stroke_width=2, stroke_fill=(0, 0, 0))
