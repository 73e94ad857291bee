"""Decoded textures of mesh files."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.files.images import decode_srgb, has_alpha, texture_alpha, texture_pixels
from iprt.files.safe_reading import MAX_PIXELS

RED, GREEN, ALPHA = 0, 1, 3
"""Channels of a picture."""


class Textures:
    """Decoded textures of one mesh file, each stored once and shared by its materials."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._texels = 0
        self._decoded: dict[bytes, NDArray[np.float32]] = {}

    def count(self, texels: int) -> None:
        """Add the texels of a texture to the total; raise FormatError above the limit."""
        self._texels += texels
        if self._texels > MAX_PIXELS:
            raise FormatError(
                f"{self._path}: its textures have more than the {MAX_PIXELS} pixels that are "
                "read; make them smaller (colors of vertices take four for each triangle)"
            )

    def linear(self, image: Any) -> NDArray[np.float32] | None:
        """Return the linear (H, W, 3) float32 texels of a Pillow image; None for other objects.

        Raises
        ------
        FormatError
            The image is damaged or of an unread format, or the total of texels is too large.
        """
        return self._decode(image, "color", decode_srgb)

    def stored(self, image: Any) -> NDArray[np.float32] | None:
        """Return the texels (H, W, 3) float32 of linear values; errors as above."""
        return self._decode(image, "stored", _fractions)

    def factors(self, image: Image.Image) -> NDArray[np.float32] | None:
        """Return a grey image (H, W) float32, None if all of it is 1."""
        grey = np.asarray(image.convert("L"))
        self.count(grey.size)
        return None if grey.min() == 255 else _fractions(grey)

    def surface(self, image: Any) -> NDArray[np.float32] | None:
        """Return metalness and roughness, (H, W, 2) float32, of a glTF map; errors as above.

        The blue channel holds metalness, the green one roughness (section 3.9.2).
        """
        return self._decode(image, "surface", lambda pixels: _fractions(pixels[..., 2:0:-1]))

    def opacity(self, image: Any) -> NDArray[np.float32] | None:
        """Return the alpha channel (H, W) float32, None if all of it is 1; errors as above."""
        if not isinstance(image, Image.Image) or not has_alpha(image):
            return None
        alpha = texture_alpha(image, self._path)
        return None if alpha.min() == 255 else _fractions(alpha)

    def normals(self, image: Any, scale: float) -> NDArray[np.float32] | None:
        """Return the vectors (H, W, 3) float32 of a normal map; errors as above.

        `scale` multiplies their x and y (section 3.9.3).
        """
        stretch = np.array([scale, scale, 1.0], np.float32)

        def vectors(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
            return np.asarray((2.0 * _fractions(pixels) - 1.0) * stretch, np.float32)

        return self._decode(image, f"normals {scale}", vectors)

    def channels(self, image: Image.Image, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Return all channels (H, W, 4), as stored, of an image of another size (W, H).

        Channels are red, green, blue and alpha; errors as above.
        """
        color, alpha = texture_pixels(image, self._path), texture_alpha(image, self._path)
        pixels = Image.fromarray(np.dstack([color, alpha]))
        if pixels.size == size:
            return np.asarray(pixels)
        planes = [plane.resize(size, Image.Resampling.BILINEAR) for plane in pixels.split()]
        return np.dstack([np.asarray(plane) for plane in planes])

    def _decode(
        self,
        image: Any,
        use: str,
        decode: Callable[[NDArray[np.uint8]], NDArray[np.float32]],
    ) -> NDArray[np.float32] | None:
        if not isinstance(image, Image.Image):
            return None
        pixels = texture_pixels(image, self._path)
        key = f"{use} {pixels.shape}".encode()
        digest = hashlib.blake2b(key + pixels.tobytes()).digest()
        if digest not in self._decoded:
            self.count(pixels.shape[0] * pixels.shape[1])
            self._decoded[digest] = decode(pixels)
        return self._decoded[digest]


def _fractions(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
    return np.divide(pixels, 255.0, dtype=np.float32)
