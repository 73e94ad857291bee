"""Names and lines in the texts of OBJ, MTL and PLY files."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO


def material_maps(data: bytes) -> Iterator[str]:
    """Yield the names of the color textures of an MTL file."""
    for line in lines_of(data):
        key, _, rest = line.partition(" ")
        if key.lower() == "map_kd" and rest.strip():
            yield without_options(rest.strip())


def without_options(text: str) -> str:
    """Return the file name after options such as `-s 1 1 1`."""
    words = text.split()
    return words[-1] if any(word.startswith("-") for word in words) else text


def ply_textures(data: bytes) -> Iterator[str]:
    """Yield the names of the textures of a PLY file."""
    for line in BytesIO(data):
        text = line.decode("utf-8", "replace").strip()
        if text == "end_header":
            return
        if text.lower().startswith("comment texturefile"):
            yield text[len("comment texturefile") :].strip()


def lines_of(data: bytes) -> Iterator[str]:
    """Yield the lines of a text, stripped and with tabs replaced by spaces."""
    for line in BytesIO(data):
        yield line.decode("utf-8", "replace").replace("\t", " ").strip()
