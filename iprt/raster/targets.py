"""Render targets of the rasterizer, and reading them back to NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material_needs import MaterialNeeds
from iprt.raster.region import Rect

DEPTH_BYTES = 4
"""Bytes of a depth texel, as drivers store it."""


def texture_bytes(texture: moderngl.Texture) -> int:
    """Return the bytes of a texture without mipmaps, as requested; drivers may round up."""
    texel = DEPTH_BYTES if texture.depth else texture.components * int(texture.dtype[1:])
    return int(texture.width * texture.height * texel)


@dataclass(frozen=True)
class Target:
    """A framebuffer with float32 images; texel (x, y) is the pixel in column x and row y."""

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
        """Create a framebuffer with `images` float32 textures of a size (width, height)."""
        textures = tuple(context.texture(size, channels, dtype="f4") for _ in range(images))
        return cls(context.framebuffer(textures, depth), textures)

    def read(self, image: int, regions: Sequence[Rect]) -> NDArray[np.float32]:
        """Return one image as (H, W, 4) float32, read within the regions and 0 elsewhere."""
        width, height = self.framebuffer.size
        pixels = np.zeros((height, width, 4), np.float32)
        self.read_into(pixels, image, regions)
        return pixels

    def read_into(self, pixels: NDArray[np.float32], image: int, regions: Sequence[Rect]) -> None:
        """Overwrite the regions of an (H, W, 4) float32 array with one image."""
        for rect in regions:
            data = self.framebuffer.read(rect.viewport, components=4, attachment=image, dtype="f4")
            texels = np.frombuffer(data, np.float32)
            pixels[rect.pixels] = texels.reshape(rect.y1 - rect.y0, rect.x1 - rect.x0, 4)

    @property
    def nbytes(self) -> int:
        """Bytes of all images."""
        return sum(map(texture_bytes, self.images))

    def release(self) -> None:
        """Free the framebuffer and its images."""
        self.framebuffer.release()
        for image in self.images:
            image.release()


@dataclass(frozen=True)
class Targets:
    """All render targets of a view.

    Attributes
    ----------
    size : (width, height)
        Pixels.
    depth : moderngl.Renderbuffer
        Depth buffer shared by `facing` and `away`.
    facing, away : Target
        1 + index of the nearest front-facing and of the nearest back-facing triangle.
    front, back : Target
        The arrays of `Layer`. If meshes deform, the front also has (displacement, 0) in world
        space. With principled or emitting materials (metalness, alpha, 0, 0) follows, and with
        emitting ones (emitted radiance, 0).
    display : Target
        The arrays of `ObjectLayers.display`.
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
        cls,
        context: moderngl.Context,
        size: tuple[int, int],
        *,
        deforming: bool,
        needs: MaterialNeeds,
    ) -> Targets:
        """Create all targets for a size (width, height)."""
        depth = context.depth_renderbuffer(size)
        return cls(
            size,
            depth,
            facing=Target.create(context, size, images=1, channels=1, depth=depth),
            away=Target.create(context, size, images=1, channels=1, depth=depth),
            front=Target.create(context, size, images=needs.display_images - 1 + deforming),
            back=Target.create(context, size, images=2),
            display=Target.create(context, size, images=needs.display_images),
        )

    @property
    def _all(self) -> tuple[Target, ...]:
        return self.facing, self.away, self.front, self.back, self.display

    @property
    def nbytes(self) -> int:
        """Bytes of all images and of the depth buffer."""
        width, height = self.size
        return sum(target.nbytes for target in self._all) + DEPTH_BYTES * width * height

    def release(self) -> None:
        """Free all targets."""
        for target in self._all:
            target.release()
        self.depth.release()
