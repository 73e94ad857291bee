"""The images that rasterization renders into, and their way to NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from iprt.raster.region import Rect

DEPTH_BYTES = 4
"""A texel of depth takes as many, as drivers store it."""


def texture_bytes(texture: moderngl.Texture) -> int:
    """Bytes of a texture without mipmaps, as it was asked for; drivers may round up."""
    texel = DEPTH_BYTES if texture.depth else texture.components * int(texture.dtype[1:])
    return int(texture.width * texture.height * texel)


@dataclass(frozen=True)
class Target:
    """A framebuffer with float32 images; texel (x, y) is the pixel in column x, row y."""

    framebuffer: moderngl.Framebuffer
    images: tuple[moderngl.Texture, ...]

    @classmethod
    def create(
        cls,
        context: moderngl.Context,
        size: tuple[int, int],
        *,
        images: int,
        channels: int = 4,
        depth: moderngl.Renderbuffer | None = None,
    ) -> Target:
        textures = tuple(context.texture(size, channels, dtype="f4") for _ in range(images))
        return cls(context.framebuffer(textures, depth), textures)

    def read(self, image: int, regions: Sequence[Rect]) -> NDArray[np.float32]:
        """(H, W, 4) float32 of one image within the regions, 0 elsewhere."""
        width, height = self.framebuffer.size
        pixels = np.zeros((height, width, 4), np.float32)
        self.read_into(pixels, image, regions)
        return pixels

    def read_into(self, pixels: NDArray[np.float32], image: int, regions: Sequence[Rect]) -> None:
        """Overwrite the regions of (H, W, 4) float32 with one image's."""
        for rect in regions:
            data = self.framebuffer.read(rect.viewport, components=4, attachment=image, dtype="f4")
            texels = np.frombuffer(data, np.float32)
            pixels[rect.pixels] = texels.reshape(rect.y1 - rect.y0, rect.x1 - rect.x0, 4)

    @property
    def nbytes(self) -> int:
        return sum(map(texture_bytes, self.images))

    def release(self) -> None:
        self.framebuffer.release()
        for image in self.images:
            image.release()


@dataclass(frozen=True)
class Targets:
    """All that is rendered for a view.

    Attributes
    ----------
    size : (width, height)
        Pixels.
    depth : moderngl.Renderbuffer
        Depth of `facing` and of `away`.
    facing, away : Target
        1 + number of the nearest triangle that faces the capture centre, and that faces away.
    front, back : Target
        The arrays of `Layer`; where meshes deform, the front has (displacement, 0), in world space,
        too.
    display : Target
        The arrays of the displayed front layer, and what else `ObjectLayers.display` holds.
    """

    size: tuple[int, int]
    depth: moderngl.Renderbuffer
    facing: Target
    away: Target
    front: Target
    back: Target
    display: Target

    @classmethod
    def create(
        cls, context: moderngl.Context, size: tuple[int, int], *, deforming: bool
    ) -> Targets:
        depth = context.depth_renderbuffer(size)
        return cls(
            size,
            depth,
            facing=Target.create(context, size, images=1, channels=1, depth=depth),
            away=Target.create(context, size, images=1, channels=1, depth=depth),
            front=Target.create(context, size, images=3 if deforming else 2),
            back=Target.create(context, size, images=2),
            display=Target.create(context, size, images=3),
        )

    @property
    def _all(self) -> tuple[Target, ...]:
        return self.facing, self.away, self.front, self.back, self.display

    @property
    def nbytes(self) -> int:
        """Bytes of all images and of the depth."""
        width, height = self.size
        return sum(target.nbytes for target in self._all) + DEPTH_BYTES * width * height

    def release(self) -> None:
        for target in self._all:
            target.release()
        self.depth.release()
