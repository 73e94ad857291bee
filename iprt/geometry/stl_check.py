"""Checks of an STL file before it is read.

Format: 3D Systems, "StereoLithography Interface Specification", 1988: text from `solid` to
`endsolid`, or a header of 80 bytes, the number of triangles, and 50 bytes for each.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.safe_reading import MAX_TRIANGLES

MAX_SOLIDS = 1024
"""Limit for the solids of a text file."""
_HEADER = 84
_TRIANGLE = 50
_NUMBER = rb"[ \t]+[-+]?(?:\d+(?:\.\d*)?|\.\d+|nan|inf)(?:e[-+]?\d+)?"
_LINE = re.compile(
    rb"^[ \t]*(?:(facet|endfacet|endsolid)\b|(vertex)(?:%s){3}[ \t]*\r?$)" % _NUMBER,
    re.IGNORECASE | re.MULTILINE,
)
_NAMED = re.compile(rb"^[ \t]*((?:end)?solid)\b.*$", re.IGNORECASE | re.MULTILINE)


def check_stl(path: Path, data: bytes) -> None:
    """Check that a binary file has the length that its header implies.

    Raises
    ------
    FormatError
        The file is damaged, cut off or too large.
    """
    head, size = data[:_HEADER], len(data)
    count = _claimed(head)
    if _is_binary(data):
        if count > MAX_TRIANGLES:
            raise FormatError(f"{path}: claims {count} triangles; at most {MAX_TRIANGLES} are read")
    elif b"\0" in head or head.lstrip()[:5].lower() != b"solid":
        raise FormatError(
            f"{path}: cut off or damaged STL file ({size} bytes; a header with {count} triangles "
            f"would need {_HEADER + count * _TRIANGLE})"
        )


def checked_stl_text(data: bytes) -> bytes:
    """Return a text file without the names of its solids, or a binary file unchanged.

    trimesh would take keywords in these names for statements.

    Raises
    ------
    ValueError
        Solids, facets or numbers are incomplete; the message is one line.
    """
    if _is_binary(data):
        return data
    count = Counter((match[1] or match[2]).lower().decode() for match in _LINE.finditer(data))
    facets, vertices = count["facet"], count["vertex"]
    if facets > MAX_TRIANGLES or count["endsolid"] > MAX_SOLIDS:
        raise ValueError(
            f"{facets} triangles in {count['endsolid']} solids; at most {MAX_TRIANGLES} and "
            f"{MAX_SOLIDS} are read"
        )
    if not (facets == count["endfacet"] and 3 * facets == vertices):
        raise ValueError(
            f"{facets} facets with {vertices} vertices, of which {count['endfacet']} end"
        )
    if not count["endsolid"]:
        raise ValueError("no endsolid")
    return _NAMED.sub(rb"\1", data)


def has_colors(data: bytes) -> bool:
    """Return True if triangles of a binary file may have colors, which no standard defines."""
    attributes = (data[_HEADER + _TRIANGLE - byte :: _TRIANGLE] for byte in (2, 1))
    return _is_binary(data) and any(map(any, attributes))


def _claimed(head: bytes) -> int:
    return int.from_bytes(head[_HEADER - 4 : _HEADER], "little")


def _is_binary(data: bytes) -> bool:
    return len(data) >= _HEADER and len(data) == _HEADER + _claimed(data) * _TRIANGLE
