"""Checks of a PLY header before the file is read.

Format: G. Turk, "The PLY Polygon File Format", 1994.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.safe_reading import MAX_TRIANGLES, MAX_VERTICES

_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16", "float16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "int64", "uint64", "float64"), 8),
}
_MAX_HEADER_LINES = 1000
_MAX_LINE = 4096


@dataclass
class _Element:
    """A declared element.

    Attributes
    ----------
    size : int
        Size of an entry with empty lists: in bytes, or in numbers for text files.
    """

    name: str
    count: int
    size: int = 0
    properties: set[str] = field(default_factory=set)


def check_ply(path: Path, data: bytes) -> list[str]:
    """Check the header of a PLY file and the least size that it implies.

    Returns
    -------
    list of str
        Names of the elements that are not empty.

    Raises
    ------
    FormatError
        The file is damaged, cut off or too large.
    """
    file = BytesIO(data)
    try:
        elements, is_text = _header(file)
    except (ValueError, KeyError, IndexError) as error:
        raise FormatError(f"{path}: cut off or damaged PLY file (its header)") from error
    present = len(data) - file.tell()
    needed = 0
    for element in elements:
        most = MAX_TRIANGLES if element.name == "face" else MAX_VERTICES
        if element.count > most:
            raise FormatError(
                f"{path}: claims {element.count} of '{element.name}'; at most {most} are read"
            )
        # A number in text takes at least a digit and a separator.
        needed += element.count * element.size * (2 if is_text else 1)
    if needed > present + is_text:
        raise FormatError(
            f"{path}: cut off or damaged PLY file ({present} bytes of at least {needed})"
        )
    return [element.name for element in elements if element.count]


def _header(file: BytesIO) -> tuple[list[_Element], bool]:
    """Parse the header; return the elements and a flag for text, with the file at the data."""
    if file.readline(_MAX_LINE).strip() != b"ply":
        raise ValueError("no PLY")
    kind = file.readline(_MAX_LINE).split()
    if kind[0] != b"format" or kind[2] != b"1.0":
        raise ValueError("no format")
    is_text = {b"ascii": True, b"binary_little_endian": False, b"binary_big_endian": False}[kind[1]]
    elements: list[_Element] = []
    for _ in range(_MAX_HEADER_LINES):
        words = file.readline(_MAX_LINE).decode("utf-8").split()
        if words == ["end_header"]:
            if any(element.count and not element.size for element in elements):
                raise ValueError("an element without properties")
            return elements, is_text
        if words[0] == "element":
            _, name, count = words
            if not count.isdecimal() or any(name == known.name for known in elements):
                raise ValueError("count")
            elements.append(_Element(name, int(count)))
        elif words[0] == "property":
            _add_property(elements[-1], words, is_text)
        elif words[0] not in ("comment", "obj_info"):
            raise ValueError("unknown line")
    raise ValueError("no end")


def _add_property(element: _Element, words: list[str], is_text: bool) -> None:
    """Add a declaration `property float x` or `property list uchar int vertex_indices`."""
    types = words[2:4] if words[1] == "list" else words[1:2]
    if words[-1] in element.properties or len(words) != len(types) + (3 if len(types) == 2 else 2):
        raise ValueError("property")
    sizes = [_BYTES[name] for name in types]
    element.properties.add(words[-1])
    element.size += 1 if is_text else sizes[0]
