"""Pictures beside a USD stage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.files.images import srgb_encode
from iprt.output.picture import write_exr, write_pixels

Float32 = NDArray[np.float32]


class Pictures:
    """Writer of pictures into a folder beside a stage; equal ones are written once.

    Parameters
    ----------
    folder : Path
        Made with the first picture.

    Attributes
    ----------
    names : list of str
        Names of the written files.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._written: dict[tuple[str, int, int | None], str] = {}
        self._kept: list[Float32 | None] = []
        self.names: list[str] = []

    def radiance(self, name: str, color: Float32) -> str:
        """Write linear radiance (H, W, 3) as EXR, and return its path relative to the stage."""
        return self._named(f"{name}.exr", lambda path: write_exr(path, color, half=True))

    def color(self, name: str, texture: Float32, opacity: Float32 | None = None) -> str:
        """Write linear values (H, W, 3) as sRGB, with opacity (H, W) as alpha."""
        coded = srgb_encode(np.clip(texture, 0.0, 1.0))
        return self._levels("color", name, coded, texture, opacity)

    def factors(self, name: str, texture: Float32) -> str:
        """Write metalness and roughness (H, W, 2) as the channels blue and green, as in glTF."""
        planes = np.ones((*texture.shape[:2], 3), np.float32)
        planes[..., 2], planes[..., 1] = texture[..., 0], texture[..., 1]
        return self._levels("factors", name, planes, texture)

    def normals(self, name: str, vectors: Float32) -> str:
        """Write the directions of vectors (H, W, 3) of any length."""
        length = np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
        return self._levels("normals", name, 0.5 + 0.5 * vectors / length, vectors)

    def _levels(
        self,
        use: str,
        name: str,
        values: NDArray[Any],
        source: Float32,
        opacity: Float32 | None = None,
    ) -> str:
        key = use, id(source), None if opacity is None else id(opacity)
        if key not in self._written:
            self._kept += [source, opacity]  # or another could get its id
            if opacity is not None:
                values = np.concatenate([values, opacity[..., None]], axis=-1)
            pixels = np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
            path = self._named(f"{name}.png", lambda path: write_pixels(path, pixels))
            self._written[key] = path
        return self._written[key]

    def _named(self, name: str, write: Callable[[Path], None]) -> str:
        stem, dot, suffix = name.rpartition(".")
        number = 2
        while name in self.names:
            name, number = f"{stem}_{number}{dot}{suffix}", number + 1
        write(self._folder / name)
        self.names.append(name)
        return f"./{self._folder.name}/{name}"
