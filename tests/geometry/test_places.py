"""Maps of glTF materials that lie elsewhere than the color: each is read to its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.geometry.material import Material
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from iprt.scene.objects import painted
from tests.geometry.gltf_files import GltfFile
from tests.geometry.gltf_models import image

Float = NDArray[np.float64]
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]])
"""Of two triangles that are not in a plane, so that their flat normals divide vertices."""
UVS = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
OTHER = np.array([[0.7, 0.2], [0.8, 0.6], [0.3, 0.9], [0.1, 0.3]])
"""Texture coordinates of the corners as stored, v down, in either set."""
DIFFER = "texture coordinates that differ between a material's textures; the color's are used"
TILED = {"scale": [4.0, 4.0]}
TURNED = {"rotation": 0.4, "scale": [2.0, 0.5], "offset": [0.1, 0.3]}
Transform = dict[str, Any]


def reference(number: int, transform: Transform | None = None, coordinates: int = 0) -> Any:
    """Return the reference of a material to a texture."""
    given = {} if transform is None else {"extensions": {"KHR_texture_transform": transform}}
    return {"index": number, "texCoord": coordinates, **given}


def model(folder: Path, *, normals: bool = False, **material: Any) -> Path:
    """Write a mesh whose material refers to textures 0 to 3."""
    file = GltfFile()
    attributes = {"TEXCOORD_0": file.array(UVS), "TEXCOORD_1": file.array(OTHER)}
    if normals:
        attributes["NORMAL"] = file.array(np.tile([0.0, 0.0, 1.0], (4, 1)))
    number = file.mesh(CORNERS, [[0, 1, 2], [0, 2, 3]], **attributes)
    file.document["meshes"][number]["primitives"][0]["material"] = 0
    file.document.update(textures=[], images=[], materials=[material])
    pixels = np.random.default_rng(3).integers(0, 256, (4, 4, 4, 4), dtype=np.uint8)
    for each in pixels:
        image(file, each)
    file.node(mesh=number)
    return file.write(folder / "m.glb")


def stored(transform: Transform, uvs: Float) -> Float:
    """Return coordinates, v down, after a transform: its matrices as the extension states them."""
    c, s = np.cos(transform.get("rotation", 0.0)), np.sin(transform.get("rotation", 0.0))
    turn = np.array([[c, s], [-s, c]])
    scale = np.diag(transform.get("scale", [1.0, 1.0]))
    return np.asarray(uvs @ (turn @ scale).T + transform.get("offset", [0.0, 0.0]))


def laid(mesh: Mesh, number: int) -> Float:
    """Return the coordinates of map `number` of the mesh's material at its vertices, v up."""
    place = mesh.materials[0].map_places[number]
    if place is None:
        return mesh.uvs.astype(np.float64)
    return place.coordinates(mesh.uvs.astype(np.float64), mesh.uvs2)


def assert_laid(mesh: Mesh, number: int, expected: Float) -> None:
    """Each vertex has its corner's coordinates; `expected`: v down."""
    corner = [int(np.abs(CORNERS - p).sum(axis=1).argmin()) for p in mesh.positions]
    assert set(corner) == {0, 1, 2, 3}
    wanted = (expected * [1.0, -1.0] + [0.0, 1.0])[corner]
    np.testing.assert_allclose(laid(mesh, number), wanted, atol=1e-5)


def test_a_normal_map_is_tiled_by_itself(tmp_path: Path) -> None:
    pbr = {"baseColorTexture": reference(0)}
    mesh = load_mesh(model(tmp_path, pbrMetallicRoughness=pbr, normalTexture=reference(1, TILED)))
    assert (mesh.dropped, mesh.warnings, mesh.uvs2) == ((), (), None)
    assert_laid(mesh, 0, UVS)
    assert_laid(mesh, 2, 4.0 * UVS)
    assert MaterialNeeds.of(mesh.materials).texture_places


@pytest.mark.parametrize("transform", [None, TURNED])
def test_emission_on_the_second_set(tmp_path: Path, transform: Transform | None) -> None:
    pbr = {"baseColorTexture": reference(0, TILED)}
    glow = reference(1, transform, 1)
    path = model(tmp_path, pbrMetallicRoughness=pbr, emissiveFactor=[1, 1, 1], emissiveTexture=glow)
    mesh = load_mesh(path)
    assert mesh.dropped == ()
    assert mesh.uvs2 is not None
    assert len(mesh.uvs2) == len(mesh.positions) == 6
    assert_laid(mesh, 0, 4.0 * UVS)
    assert_laid(mesh, 3, stored(transform or {}, OTHER))


def test_each_map_at_its_own_place(tmp_path: Path) -> None:
    """The color is on the second set."""
    pbr = {
        "baseColorTexture": reference(0, TURNED, 1),
        "metallicRoughnessTexture": reference(1, TILED, 1),
    }
    glow, bumps = reference(2, {"offset": [0.5, 0.1]}), reference(3, TURNED, 1)
    path = model(
        tmp_path,
        pbrMetallicRoughness=pbr,
        emissiveFactor=[1, 1, 1],
        emissiveTexture=glow,
        normalTexture=bumps,
    )
    mesh = load_mesh(path)
    assert mesh.dropped == ()
    assert_laid(mesh, 0, stored(TURNED, OTHER))
    assert_laid(mesh, 1, 4.0 * OTHER)
    assert_laid(mesh, 2, stored(TURNED, OTHER))
    assert mesh.materials[0].places[1] is None
    assert_laid(mesh, 3, UVS + np.array([0.5, 0.1]))
    # A material for the whole object has no maps there.
    assert load_mesh(path, Material()).uvs2 is None


def test_maps_that_lie_alike_have_no_places(tmp_path: Path) -> None:
    pbr = {
        "baseColorTexture": reference(0, TURNED),
        "metallicRoughnessTexture": reference(1, TURNED),
    }
    # Without a factor, nothing is emitted.
    path = model(tmp_path, pbrMetallicRoughness=pbr, emissiveTexture=reference(2, TILED, 1))
    mesh = load_mesh(path)
    assert (mesh.dropped, mesh.uvs2) == ((), None)
    assert mesh.materials[0].places == (None,) * 4


@pytest.mark.parametrize("normals", [False, True])
@pytest.mark.parametrize(("transform", "coordinates"), [(None, 1), ({"rotation": 0.7}, 0)])
def test_tangents_follow_the_normal_map(
    tmp_path: Path, normals: bool, transform: Transform | None, coordinates: int
) -> None:
    """They are the same as of a material whose color lies there too."""
    bumps = reference(1, transform, coordinates)
    meshes = [
        load_mesh(
            model(
                tmp_path,
                normals=normals,
                pbrMetallicRoughness={"baseColorTexture": color},
                normalTexture=bumps,
            )
        )
        for color in (reference(0), bumps)
    ]
    one, other = meshes
    assert one.tangents is not None
    assert other.tangents is not None
    np.testing.assert_array_equal(one.positions, other.positions)
    np.testing.assert_allclose(one.tangents, other.tangents, atol=1e-6)
    plain = load_mesh(model(tmp_path, normals=normals, normalTexture=reference(1)))
    assert plain.tangents is not None
    assert np.abs(plain.tangents[:, :3] - one.tangents[:, :3]).max() > 0.3
    # Another normal map lies where the mesh's coordinates say.
    flat = Material(normal_texture=np.float32([[[0.0, 0.0, 1.0]]]))
    bare = painted(one, flat)
    assert isinstance(bare, Mesh)
    assert bare.tangents is not None
    np.testing.assert_allclose(bare.tangents, plain.tangents, atol=1e-6)
    back = painted(bare, one.materials[0])
    assert isinstance(back, Mesh)
    assert back.tangents is not None
    np.testing.assert_allclose(back.tangents, one.tangents, atol=1e-6)


@pytest.mark.parametrize(("transform", "coordinates"), [(TURNED, 0), (TILED, 1)])
@pytest.mark.parametrize("bumps", [False, True])
def test_the_normal_map_of_a_clearcoat(
    tmp_path: Path, bumps: bool, transform: Transform, coordinates: int
) -> None:
    """It lies elsewhere. Tangents follow the other normal map, if there is one."""
    pbr = {"baseColorTexture": reference(0)}
    own = reference(2, transform, coordinates)
    coat = {"clearcoatFactor": 1.0, "clearcoatNormalTexture": own}
    more: dict[str, Any] = {"extensions": {"KHR_materials_clearcoat": coat}}
    if bumps:
        more["normalTexture"] = reference(1)
    mesh = load_mesh(model(tmp_path, pbrMetallicRoughness=pbr, **more))
    assert (mesh.dropped, mesh.warnings) == ((), ())
    assert_laid(mesh, 4, stored(transform, (UVS, OTHER)[coordinates]))
    followed = reference(1) if bumps else own
    other = load_mesh(model(tmp_path, pbrMetallicRoughness=pbr, normalTexture=followed))
    assert mesh.tangents is not None
    assert other.tangents is not None
    np.testing.assert_allclose(mesh.tangents, other.tangents, atol=1e-6)


@pytest.mark.parametrize("case", ["a color on a line", "a map of clearcoat"])
def test_what_is_read_at_the_place_of_another_is_named(tmp_path: Path, case: str) -> None:
    line = {"scale": [1.0, 0.0]} if case == "a color on a line" else {}
    pbr = {"baseColorTexture": reference(0, line), "metallicRoughnessTexture": reference(1, line)}
    more: dict[str, Any] = {"normalTexture": reference(2)}
    if not line:
        coat = {"clearcoatFactor": 1.0, "clearcoatTexture": reference(2, TILED)}
        more = {"extensions": {"KHR_materials_clearcoat": coat}}
    mesh = load_mesh(model(tmp_path, pbrMetallicRoughness=pbr, **more))
    assert mesh.dropped == (DIFFER,)
    assert_laid(mesh, 1, stored(line, UVS))
    assert mesh.materials[0].map_places == (None,) * 5
