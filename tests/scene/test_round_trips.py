"""What is written is what is read, whatever it is."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from iprt.files.images import read_depth
from iprt.footage.video.depth_code import DepthCode
from iprt.geometry.meshes import load_mesh
from iprt.scene.manifest import parse_manifest
from iprt.scene.manifest_writing import object_text
from iprt.scene.new_scene import _video_table, manifest_of
from tests.scene.files import write_channels
from tests.scene.nasty_meshes import glb, gltf, ply

SETTINGS = settings(max_examples=40, derandomize=True)
SHAPES = array_shapes(min_dims=2, max_dims=2, max_side=9)
TYPES = ("ascii", "binary_little_endian", "binary_big_endian")

coordinates = st.floats(-1e4, 1e4, width=32).filter(lambda value: value == 0.0 or abs(value) > 1e-3)
names = st.text(
    st.characters(exclude_categories=("C", "Z"), exclude_characters="/\\:"), min_size=1, max_size=20
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("round")


@SETTINGS
@given(
    values=st.one_of(
        arrays(np.float32, SHAPES), arrays(np.float16, SHAPES), arrays(np.uint32, SHAPES)
    )
)
def test_exr_depth_of_every_type(folder: Path, values: np.ndarray) -> None:
    write_channels(folder / "d.exr", Z=values)
    depth, bits = read_depth(folder / "d.exr")
    assert np.array_equal(depth, values.astype(np.float32), equal_nan=True)
    assert bits == (32 if values.dtype == np.uint32 else 0)


@st.composite
def solids(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and triangles (F, 3), none of which is flat."""
    count = draw(st.integers(3, 12))
    vertices = draw(arrays(np.float32, (count, 3), elements=coordinates))
    triangles = draw(
        arrays(np.int32, (draw(st.integers(1, 9)), 3), elements=st.integers(0, count - 1))
    )
    corners = vertices[triangles].astype(np.float64)
    edges = corners - np.roll(corners, 1, axis=1)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    usable = area > 1e-4 * np.einsum("fij,fij->fi", edges, edges).max(axis=1, initial=0.0)
    if not usable.any():
        vertices[:3], triangles, usable = np.eye(3), np.array([[0, 1, 2]], np.int32), [True]
    return vertices, triangles[usable]


def same(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> bool:
    """All corners of all triangles, whichever way the reader numbers and orders them."""
    mesh = load_mesh(path)
    read = mesh.positions[mesh.triangles].reshape(-1, 9)
    wanted = vertices[triangles].reshape(-1, 9)
    return np.array_equal(read[np.lexsort(read.T)], wanted[np.lexsort(wanted.T)])


@SETTINGS
@given(solid=solids(), kind=st.sampled_from(TYPES))
def test_ply(folder: Path, solid: tuple[np.ndarray, np.ndarray], kind: str) -> None:
    vertices, triangles = solid
    if kind == "ascii":
        rows = [" ".join(map(repr, map(float, row))) for row in vertices]
        rows += [" ".join(map(str, [3, *row])) for row in triangles]
        data = "\n".join(rows).encode() + b"\n"
    else:
        order = "<" if "little" in kind else ">"
        data = vertices.astype(f"{order}f4").tobytes()
        data += b"".join(struct.pack(f"{order}B3i", 3, *row) for row in triangles)
    (folder / "m.ply").write_bytes(ply(len(vertices), len(triangles), data, kind))
    assert same(folder / "m.ply", vertices, triangles)


@SETTINGS
@given(solid=solids())
def test_obj(folder: Path, solid: tuple[np.ndarray, np.ndarray]) -> None:
    vertices, triangles = solid
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.astype(float).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()]
    (folder / "m.obj").write_text("\n".join(lines))
    assert same(folder / "m.obj", vertices, triangles)


@SETTINGS
@given(solid=solids(), binary=st.booleans())
def test_gltf(folder: Path, solid: tuple[np.ndarray, np.ndarray], binary: bool) -> None:
    vertices, triangles = solid
    data = vertices.astype("<f4").tobytes() + triangles.astype("<u2").tobytes()
    data += bytes(-len(data) % 4)
    document = json.loads(gltf({"buffers.0.uri": None}))
    document["accessors"][0]["count"] = len(vertices)
    document["accessors"][1]["count"] = triangles.size
    document["bufferViews"][0]["byteLength"] = 12 * len(vertices)
    document["bufferViews"][1] = {
        "buffer": 0,
        "byteOffset": 12 * len(vertices),
        "byteLength": 2 * triangles.size,
    }
    document["buffers"][0]["byteLength"] = len(data)
    if binary:
        (folder / "m.glb").write_bytes(glb(json.dumps(document), data))
    else:
        document["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(data).decode()
        (folder / "m.gltf").write_text(json.dumps(document))
    assert same(folder / ("m.glb" if binary else "m.gltf"), vertices, triangles)


@SETTINGS
@given(
    name=names,
    mesh=names.filter(lambda text: text not in (".", "..")),
    offset=arrays(np.float64, 3, elements=st.floats(-1e5, 1e5)),
    scale=st.floats(1e-3, 1e3),
    depth_scale=st.none() | st.floats(1e-6, 1e6),
    frames=st.tuples(st.integers(0, 999), st.integers(0, 999)).map(sorted),
)
def test_manifests_as_they_are_written(
    name: str,
    mesh: str,
    offset: np.ndarray,
    scale: float,
    depth_scale: float | None,
    frames: list[int],
) -> None:
    to_world = np.diag([scale, scale, scale, 1.0])
    to_world[:3, 3] = offset
    material = {"kind": "plastic", "albedo": [0.25, 0.5, 1.0], "alpha": 0.125}
    files = {"color": "c.%04d.exr", "depth": "d.%d.exr"}
    video = _video_table(files, DepthCode(depth_scale), (frames[0], frames[1]))
    text = manifest_of(name, video)
    table = object_text(name=name, mesh=mesh, to_world=to_world, material=material)
    manifest = parse_manifest(text + table, "scene.toml")
    assert manifest.name == manifest.objects[0].name == name
    assert manifest.objects[0].mesh == mesh
    written, dirt = np.reshape(manifest.objects[0].to_world, (4, 4)), 1e-9 * np.abs(to_world).max()
    np.testing.assert_allclose(written, to_world, rtol=1e-6, atol=dirt)
    assert manifest.video.depth_scale == depth_scale
    assert manifest.video.frames == frames
    assert manifest.objects[0].material is not None
    assert manifest.objects[0].material.model_dump(include=set(material)) == material
