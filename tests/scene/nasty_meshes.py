"""Meshes made to hurt whoever reads them, each with the error that it must give."""

from __future__ import annotations

import base64
import copy
import json
import struct
from pathlib import Path
from typing import Any

from tests.scene.files import CUBE
from tests.scene.nasty import ZEROS, nasty, nasty_script, png

HEAD = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
)
FACES = "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
BINARY = "binary_little_endian"
CORNERS = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)


def ply(vertices: object, faces: object, data: bytes = b"", kind: str = BINARY) -> bytes:
    return (HEAD.format(kind, vertices) + FACES.format(faces)).encode() + data


FACE, NAN = struct.pack("<B3i", 3, 0, 1, 2), struct.pack("<9f", *[float("nan")] * 9)
MESH = "cut off or damaged mesh file"
for _name, _ply, _message in (
    ("of 2^31 vertices", ply(2**31, 1), "claims 2147483648 of 'vertex'"),
    ("of 10^30 faces", ply(3, 10**30), "of 'face'; at most"),
    ("of 10^7 absent vertices", ply(10**7, 1), "0 bytes of at least"),
    ("text of 10^7 rows", ply(10**7, 1, b"0 0 0\n", "ascii"), "6 bytes of at"),
    ("of -5 vertices", ply(-5, 1), "damaged PLY file (its header)"),
    ("without an end", HEAD.format(BINARY, 3) + "comment a\n" * 10**5, "header"),
    ("with a line of 10 MB", "ply\nformat " + "a" * 10**7, "its header"),
    (
        "with 10^7 nothings",
        HEAD.format(BINARY, 3) + "element none 10000000\n" + FACES.format(1),
        "its header",
    ),
    ("list beyond the file", ply(3, 1, CORNERS + b"\xff" + FACE[1:]), MESH),
    ("triangle of a fourth vertex", ply(3, 1, CORNERS + struct.pack("<B3i", 3, 0, 1, 3)), MESH),
    ("triangle of vertex -1", ply(3, 1, CORNERS + struct.pack("<B3i", 3, 0, 1, -1)), MESH),
    ("of NaN", ply(3, 1, NAN + FACE), "holds no triangles"),
):
    nasty("mesh", "m.ply", f"PLY {_name}", _ply, _message)

for _name, _line, _message in (
    ("OBJ with materials of the net", "mtllib http://a.b/m.mtl", "on the net"),
    ("OBJ with materials of the system", "mtllib /etc/passwd", "outside its folder"),
    ("OBJ with materials above", "mtllib a/../../m.mtl", "outside its folder"),
    ("OBJ with materials above, in Windows", "mtllib ..\\m.mtl", "outside its folder"),
    ("OBJ with materials nowhere", f"mtllib {'a' * 5000}", "missing"),
    ("OBJ with a zero byte in a name", "mtllib a\0b.mtl", "missing"),
    ("OBJ of a ninth vertex", "f 1 2 99", "cut off or damaged mesh file"),
    ("OBJ of vertex -99", "f 1 2 -99", "cut off or damaged mesh file"),
    ("OBJ of a vertex beyond 64 bits", f"f 1 2 {10**30}", "cut off or damaged mesh file"),
):
    nasty("mesh", "m.obj", _name, f"{_line}\n{CUBE}{_line}\n", _message)
nasty(
    "mesh",
    "m.obj",
    "OBJ of 5000 materials",
    CUBE + "".join(f"usemtl {i}\nf 1 2 3\n" for i in range(5000)),
    "5000 materials",
)


@nasty_script("mesh", "m.obj", "t.png: cannot be read as a picture")
def texture_that_ghostscript_would_run(path: Path) -> None:
    path.write_text("mtllib m.mtl\nusemtl a\n" + CUBE)
    path.with_name("m.mtl").write_text("newmtl a\nmap_Kd t.png\n")
    path.with_name("t.png").write_text(
        "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n(made) (w) file\n"
    )


@nasty_script("mesh", "m.obj", "t.png: claims")
def texture_of_2_to_the_28_pixels(path: Path) -> None:
    path.write_text("mtllib m.mtl\nusemtl a\n" + CUBE)
    path.with_name("m.mtl").write_text("newmtl a\nmap_Kd -s 1 1 1 t.png\n")
    path.with_name("t.png").write_bytes(png(2**14, 10**4, 8, ZEROS))


DATA = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) + struct.pack("<4H", 0, 1, 2, 0)
GLTF: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 1]}}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": 36},
        {"buffer": 0, "byteOffset": 36, "byteLength": 8},
    ],
    "buffers": [{"byteLength": 44, "uri": "data:;base64," + base64.b64encode(DATA).decode()}],
}
"""A triangle."""


def gltf(changes: dict[str, Any]) -> str:
    """The triangle with other values at paths such as `accessors.0.count`; None takes away."""
    document = copy.deepcopy(GLTF)
    for path, value in changes.items():
        *way, last = [int(part) if part.isdecimal() else part for part in path.split(".")]
        at: Any = document
        for step in way:
            at = at[step]
        if value is None:
            del at[last]
        else:
            at[last] = value
    return json.dumps(document)


def glb(document: str, data: bytes = b"") -> bytes:
    text = document.encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if data:
        body += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


SPARSE = {
    "count": 1,
    "indices": {"bufferView": 0, "byteOffset": 12, "componentType": 5125},
    "values": {"bufferView": 0},
}
CHAIN = [{"children": [i + 1]} for i in range(999)] + [{"mesh": 0}]
VIEWS = GLTF["bufferViews"] + [{"buffer": 0, "byteLength": 40_000}] * 70_000
PRIMITIVES = GLTF["meshes"][0]["primitives"] * 20_000
OFTEN = {
    "meshes.0.primitives": PRIMITIVES[:10_000],
    "nodes": [{"mesh": 0}] * 10_000,
    "scenes": [{"nodes": list(range(10_000))}],
}
MANY = {
    "accessors.0.count": 10_000_000,
    "bufferViews.0.byteLength": 120_000_000,
    "buffers.0.byteLength": 120_000_044,
    "nodes": [{"mesh": 0}] * 10,
    "scenes": [{"nodes": list(range(10))}],
}
for _name, _changes, _message in (
    ("glTF accessor of 2^40", {"accessors.0.count": 2**40}, "accessors[0].count: "),
    ("glTF accessor beyond its view", {"accessors.0.count": 4}, "accessors[0]: ends beyond"),
    ("glTF accessor at an end", {"accessors.0.byteOffset": 2**30}, "accessors[0]: ends beyond"),
    ("glTF accessor of nothing", {"accessors.0.bufferView": None}, "compressed data"),
    ("glTF sparse accessor of nothing", {"accessors.0.sparse": {"count": 1}}, "sparse"),
    (
        "glTF sparse accessor beyond its buffer",
        {"accessors.0.sparse": SPARSE | {"count": 10**7}},
        "ends beyond bufferView",
    ),
    (
        "glTF sparse accessor of elements that do not exist",
        {"accessors.0.sparse": SPARSE},
        "replaces elements that do not exist",
    ),
    ("glTF accessor of text", {"accessors.0.type": "TEXT"}, "accessors[0].type: "),
    ("glTF positions in two numbers", {"accessors.0.type": "VEC2"}, "POSITION: made of VEC2"),
    ("glTF corners that are no numbers", {"accessors.1.componentType": 5122}, "not whole numbers"),
    ("glTF corner beyond", {"bufferViews.1.byteOffset": 12}, "damaged mesh file"),
    ("glTF view beyond its buffer", {"bufferViews.0.byteLength": 45}, "bufferViews[0]: ends"),
    ("glTF view of buffer 7", {"bufferViews.0.buffer": 7}, "there is no buffer 7"),
    ("glTF buffer of 2^40", {"buffers.0.byteLength": 2**40}, "buffers[0].byteLength: "),
    ("glTF buffer cut off", {"buffers.0.uri": "data:;base64,AAAA"}, "damaged mesh file"),
    ("glTF buffer of the net", {"buffers.0.uri": "https://a.b/c.bin"}, "on the net"),
    ("glTF buffer of the system", {"buffers.0.uri": "/etc/passwd"}, "outside its folder"),
    ("glTF buffer above", {"buffers.0.uri": "%2e%2e/a.bin"}, "outside its folder"),
    ("glTF buffer by file URI", {"buffers.0.uri": "file:///etc/passwd"}, "on the net"),
    (
        "glTF of 70000 views of all",
        {"buffers.0.byteLength": 40_000, "bufferViews": VIEWS},
        "at most 2147483648 are read",
    ),
    ("glTF of 20000 primitives", {"meshes.0.primitives": PRIMITIVES}, "20000 primitives; at most"),
    ("glTF that shows 10^4 primitives 10^4 times", OFTEN, "100000000 primitives; at most"),
    ("glTF that shows 10^7 vertices ten times", MANY, "at most 16777216 and 50331648 are read"),
    ("glTF node that is its own child", {"nodes.0.children": [0]}, "root of a tree"),
    ("glTF node with two parents", {"nodes": [{"children": [1, 1]}, {}]}, "two parents"),
    ("glTF of 1000 levels", {"nodes": CHAIN}, "levels of nodes"),
    ("glTF of NaN", {"nodes.0.translation": [float("nan"), 0, 0]}, "nodes[0].translation[0]: "),
    ("glTF of a mesh that is text", {"nodes.0.mesh": "a"}, "nodes[0].mesh: "),
    ("glTF of a color that is text", {"materials.0.pbrMetallicRoughness": "a"}, "materials[0]"),
    ("glTF of scene 5", {"scene": 5}, "there is no scene 5"),
    ("glTF of a name that is a list", {"materials.0.name": ["a"]}, "materials[0].name: "),
):
    nasty("mesh", "m.gltf", _name, gltf(_changes), _message)
nasty("mesh", "m.gltf", "glTF too deep", "[" * 10**6, "m.gltf: cut off or damaged glTF")
nasty("mesh", "m.gltf", "glTF with a long number", f'{{"a": {"9" * 10**5}}}', "damaged glTF")
TEXTURED = {
    "materials.0.pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
    "textures": [{"source": 0}],
}
for _name, _data, _message in (
    ("glTF with a picture of PostScript", b"%!PS-Adobe-3.0 EPSF-3.0\n", "cannot be read as a"),
    ("glTF with a picture of 10^10 pixels", png(10**5, 10**5, 8, b"x"), "cannot be read as a"),
    ("glTF with a picture of 2^27 and more", png(2**14, 8200, 8, b"x"), "claims 16384 x 8200"),
):
    _uri = "data:image/png;base64," + base64.b64encode(_data).decode()
    nasty("mesh", "m.gltf", _name, gltf({**TEXTURED, "images": [{"uri": _uri}]}), _message)

GLB = glb(gltf({"buffers.0.uri": None}), DATA)
nasty("mesh", "m.glb", "GLB of 4 GB", GLB[:8] + b"\xff" * 4 + GLB[12:], "of 4294967295 bytes")
nasty("mesh", "m.glb", "GLB document of 4 GB", GLB[:12] + b"\xff" * 4 + GLB[16:], "do not fill it")
nasty("mesh", "m.glb", "GLB of version 1", GLB[:4] + b"\1" + GLB[5:], "no header of glTF 2")
nasty("mesh", "m.glb", "GLB without its data", glb(gltf({"buffers.0.uri": None})), "m.glb: ")


def stl(count: int, data: bytes = b"") -> bytes:
    return bytes(80) + struct.pack("<I", count) + data


TRIANGLE = bytes(12) + CORNERS + bytes(2)
STL_TEXT = "solid a\nfacet normal 0 0 0\nouter loop\n" + "vertex 0 0 {}\n" * 3 + "endloop\n"
for _name, _stl, _message in (
    ("STL of 2^32 triangles", stl(2**32 - 1, TRIANGLE), "damaged STL file (134 bytes; a header"),
    ("STL of 10^7 absent triangles", stl(10**7), "would need 500000084"),
    ("STL of nothing", b"", "damaged STL file (0 bytes"),
    ("STL of no triangles", stl(0), "m.stl: "),
    ("STL with more than it claims", stl(1, TRIANGLE * 2), "damaged STL file (184 bytes"),
    ("STL of NaN", stl(1, b"\xff" * 48 + bytes(2)), "holds no triangles"),
    ("STL text without an end", STL_TEXT.format(0, 1, 2), "1 facets with 3 vertices, of which 0"),
    ("STL text of a word", STL_TEXT.format(0, 1, "a") + "endfacet\nendsolid\n", "2 vertices"),
    ("STL text of one long number", "solid\nvertex 0 0 " + "1" * 10**6, "1 vertices"),
    ("STL text of 10^5 solids", "solid a\nendsolid a\n" * 10**5, "100000 solids; at most"),
    ("STL text that ends first", "solid\n" + "endsolid\nsolid\n" * 9, "m.stl: "),
):
    nasty("mesh", "m.stl", _name, _stl, _message)
