"""glTF files with integers for fractions are read; what is compressed is named with its remedy."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_files import GltfFile

CORNERS = np.array([[-1.0, 0.0, 0.5], [0.25, -0.5, 1.0], [0.5, 1.0, -0.75]])
UVS = np.array([[0.0, 0.25], [1.0, 0.5], [0.75, 1.0]])
NORMAL = np.array([0.6, 0.0, 0.8])


def picture(kind: str) -> str:
    buffer = io.BytesIO()
    Image.new("RGB", (2, 2), (255, 0, 0)).save(buffer, kind, lossless=True)
    return "data:;base64," + base64.b64encode(buffer.getvalue()).decode()


def textured(kind: str = "PNG") -> GltfFile:
    """A triangle with a red texture."""
    file = GltfFile()
    number = file.mesh(CORNERS, [[0, 1, 2]], TEXCOORD_0=file.array(UVS))
    file.document["meshes"][number]["primitives"][0]["material"] = 0
    file.document["images"] = [{"uri": picture(kind)}]
    file.document["textures"] = [{"source": 0}]
    pbr = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    file.document["materials"] = [{"pbrMetallicRoughness": pbr}]
    file.node(mesh=number)
    return file


def stored(values: NDArray[np.float64], dtype: str, *, fractions: bool) -> NDArray[np.float64]:
    return np.round(values * np.iinfo(dtype).max) if fractions else np.round(values * 100.0)


@pytest.mark.parametrize("fractions", [True, False])
@pytest.mark.parametrize("dtype", ["i1", "i2"])
def test_quantised_meshes_are_read(dtype: str, fractions: bool, tmp_path: Path) -> None:
    """KHR_mesh_quantization: f = max(c / top, -1) where normalised, else f = c."""
    file, top = textured(), np.iinfo(dtype).max
    unsigned = dtype.replace("i", "u")
    positions = stored(CORNERS, dtype, fractions=fractions)
    uvs = np.round(UVS * (np.iinfo(unsigned).max if fractions else 3.0))
    normals = np.tile(np.round(NORMAL * top), (3, 1))
    given = {"normalized": fractions}
    file.document["meshes"][0]["primitives"][0]["attributes"] = {
        "POSITION": file.array(positions, dtype, **given),
        "NORMAL": file.array(normals, dtype, normalized=True),
        "TEXCOORD_0": file.array(uvs, unsigned, **given),
    }
    file.document["nodes"][0].update(scale=[2, 2, 2], translation=[1, 0, 0])
    file.document["extensionsUsed"] = file.document["extensionsRequired"] = [
        "KHR_mesh_quantization"
    ]
    mesh = load_mesh(file.write(tmp_path / "q.glb"))
    decoded = positions / top if fractions else positions
    np.testing.assert_allclose(mesh.positions, 2 * decoded + [1, 0, 0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(mesh.normals, np.tile(NORMAL, (3, 1)), atol=1 / top)
    seen = uvs / np.iinfo(unsigned).max if fractions else uvs
    np.testing.assert_allclose(mesh.uvs, seen * [1, -1] + [0, 1], atol=1e-6)
    assert mesh.dropped == ()


def test_quantised_meshes_may_be_interleaved(tmp_path: Path) -> None:
    """Items of six bytes, eight bytes apart."""
    file = textured()
    rows = np.zeros((3, 4))
    rows[:, :3] = np.round(CORNERS * 32767)
    number = file.array(rows, "i2", normalized=True)
    file.document["accessors"][number]["type"] = "VEC3"
    file.document["bufferViews"][number]["byteStride"] = 8
    file.document["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = number
    mesh = load_mesh(file.write(tmp_path / "q.gltf"))
    np.testing.assert_allclose(mesh.positions, CORNERS, atol=1e-4)


def draco(file: GltfFile, *, required: bool = True) -> None:
    """A file as Draco's encoders write it: accessors without data."""
    (primitive,) = file.document["meshes"][0]["primitives"]
    extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    del file.document["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]
    need(file, "KHR_draco_mesh_compression", required=required)


def meshopt(file: GltfFile, name: str = "EXT_meshopt_compression") -> None:
    """A file as meshopt's encoders write it: a buffer that does not exist."""
    view = file.document["bufferViews"][0]
    view["extensions"] = {name: {"buffer": 0, "byteLength": 8, "byteStride": 4, "count": 3}}
    need(file, name)


def basisu(file: GltfFile) -> None:
    file.document["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    need(file, "KHR_texture_basisu")


def need(file: GltfFile, name: str, *, required: bool = True) -> None:
    for key in ("extensionsUsed", "extensionsRequired")[: 1 + required]:
        file.document.setdefault(key, []).append(name)


@pytest.mark.parametrize(
    ("changes", "phrase", "verb"),
    [
        ([draco], "Draco (KHR_draco_mesh_compression)", "copy"),
        ([lambda f: draco(f, required=False)], "Draco (KHR_draco_mesh_compression)", "copy"),
        ([meshopt], "meshopt (EXT_meshopt_compression)", "copy"),
        ([lambda f: meshopt(f, "KHR_meshopt_compression")], "(KHR_meshopt_compression)", "copy"),
        ([basisu], "BasisU (KHR_texture_basisu)", "ktxdecompress"),
        ([draco, basisu], "Draco (KHR_draco_mesh_compression) and BasisU", "ktxdecompress"),
    ],
)
@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_compressed_files_are_named_with_a_command(
    changes: list[Callable[[GltfFile], Any]],
    phrase: str,
    verb: str,
    suffix: str,
    tmp_path: Path,
) -> None:
    file = textured()
    for change in changes:
        change(file)
    path = file.write(tmp_path / f"my file{suffix}")
    with pytest.raises(FormatError) as caught:
        load_mesh(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: compressed with ")
    assert phrase in message
    plain = tmp_path / f"my file-plain{suffix}"
    assert f"gltf-transform {verb} '{path}' '{plain}' (npm install" in message
    assert "\n" not in message


def test_what_is_there_uncompressed_too_is_read(tmp_path: Path) -> None:
    file = textured()
    (primitive,) = file.document["meshes"][0]["primitives"]
    extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    file.document["images"].append({"uri": "data:;base64,AAAA"})
    file.document["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": 1}}
    for name in ("KHR_draco_mesh_compression", "KHR_texture_basisu", "EXT_meshopt_compression"):
        need(file, name, required=False)
    mesh = load_mesh(file.write(tmp_path / "q.gltf"))
    np.testing.assert_allclose(mesh.positions, CORNERS)
    assert mesh.materials[0].texture is not None
    assert mesh.dropped == ()


def test_a_texture_of_webp_is_read_and_not_named(tmp_path: Path) -> None:
    file = textured("WEBP")
    file.document["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
    need(file, "EXT_texture_webp")
    mesh = load_mesh(file.write(tmp_path / "q.gltf"))
    texture = mesh.materials[0].texture
    assert texture is not None
    np.testing.assert_allclose(texture, np.tile([1.0, 0.0, 0.0], (2, 2, 1)))
    assert mesh.dropped == ()
    file.document["images"] = [{"uri": "data:;base64,AAAA"}]
    with pytest.raises(FormatError, match=r"images\[0\]"):
        load_mesh(file.write(tmp_path / "q.gltf"))


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_a_buffer_that_is_cut_off_is_named(suffix: str, tmp_path: Path) -> None:
    file = textured()
    path = file.write(tmp_path / f"q{suffix}")
    whole = len(file.data)
    file.data = file.data[:-8]
    data = file.write(path).read_bytes()
    claim = json.dumps({"byteLength": whole - 8})[:-1].encode()
    assert claim in data
    path.write_bytes(data.replace(claim, claim.replace(b"%d" % (whole - 8), b"%d" % whole)))
    with pytest.raises(FormatError, match="buffer 0 is cut off"):
        load_mesh(path)
