"""Triangles of USD files: their places, the values that belong to them, and unread contents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.geometry.meshes import load_mesh
from tests.geometry.usd_files import corners, in_this_process, square, usda  # noqa: F401

pytest.importorskip("pxr", reason="needs the extra `usd`")
from pxr import Gf, Usd, UsdGeom, Vt

pytestmark = pytest.mark.usefixtures("in_this_process")

FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], np.float64)
"""A box of 1 x 2 x 3 m, +Y up."""


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    lines += [f"f {' '.join(str(index + 1) for index in face)}" for face in FACES]
    path = tmp_path_factory.mktemp("box") / "box.obj"
    path.write_text("\n".join(lines))
    return corners(load_mesh(path))


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("unit", [1.0, 0.01, 0.0254])
@pytest.mark.parametrize("hand", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_a_box_in_any_convention_is_the_same(
    tmp_path: Path, box: np.ndarray, up: str, unit: float, hand: str, suffix: str
) -> None:
    x, y, z = CORNERS.T
    stored = np.stack([x, -z, y] if up == "Z" else [x, y, z], axis=1) / unit
    stage = Usd.Stage.CreateNew(str(tmp_path / f"box{suffix}"))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    parent = UsdGeom.Xform.Define(stage, "/a")
    parent.AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    mesh = UsdGeom.Mesh.Define(stage, "/a/box")
    mesh.AddTranslateOp().Set(Gf.Vec3d(-5, 0, 0))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(stored.astype(np.float32)))
    faces = [face[::-1] if hand == "leftHanded" else face for face in FACES]
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr([index for face in faces for index in face])
    mesh.CreateOrientationAttr(hand)
    stage.Save()
    read = load_mesh(tmp_path / f"box{suffix}")
    assert len(read.triangles) == 12
    np.testing.assert_allclose(_area_by_side(corners(read)), _area_by_side(box), atol=1e-4)
    assert (_outward(corners(read)) > 0).all()


def _area_by_side(triangles: np.ndarray) -> np.ndarray:
    """Areas by normal: fans may cut the sides of the box along the other diagonal."""
    areas = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    places = triangles.reshape(-1, 3)
    sides = [areas[(areas * side).sum(1) > 0].sum(0) for side in np.vstack([np.eye(3), -np.eye(3)])]
    return np.vstack([*sides, places.min(0), places.max(0)])


def _outward(triangles: np.ndarray) -> np.ndarray:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return (normal * (triangles.mean(1) - (0.5, 1.0, 1.5))).sum(1)


def test_values_belong_to_corners_faces_and_vertices(tmp_path: Path) -> None:
    st = "(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5)"
    body = f"""
    def Mesh "two"
    {{
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        normal3f[] normals = [(0, 0, 1), (0, 1, 0)] (
            interpolation = "uniform"
        )
        texCoord2f[] primvars:UVMap = [{st}] (
            interpolation = "faceVarying"
        )
        int[] primvars:UVMap:indices = [0, 1, 2, 0, 4, 3]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] (
            interpolation = "vertex"
        )
    }}"""
    mesh = load_mesh(usda(tmp_path / "a.usda", body))
    by_face = {tuple(mesh.normals[t[0]].astype(int)): t for t in mesh.triangles}
    assert set(by_face) == {(0, 0, 1), (0, 1, 0)}
    (material,) = mesh.materials
    assert material.texture is not None, "vertex colors"
    second = by_face[0, 1, 0]
    np.testing.assert_allclose(mesh.positions[second], [[0, 0, 0], [1, 1, 0], [0, 1, 0]])


def test_texture_coordinates_by_corner(tmp_path: Path) -> None:
    st = "texCoord2f[] primvars:st = [(0, 0), (0.25, 0), (1, 0.5), (0, 1)]"
    body = (
        square()
        .replace("texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)]", st)
        .replace('interpolation = "vertex"', 'interpolation = "faceVarying"')
    )
    mesh = load_mesh(usda(tmp_path / "a.usda", body))
    seen = {tuple(p): tuple(uv) for p, uv in zip(mesh.positions, mesh.uvs, strict=True)}
    assert seen[1, 0, 0] == (0.25, 0)
    assert seen[1, 1, 0] == (1, 0.5)


def test_hidden_parts_holes_and_motion(tmp_path: Path) -> None:
    hidden = square('token visibility = "invisible"').replace("square", "hidden")
    proxy = square('uniform token purpose = "proxy"').replace("square", "proxy")
    hole = """
    def Mesh "hole"
    {
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        int[] holeIndices = [1]
        point3f[] points.timeSamples = {
            0: [(0, 0, 5), (1, 0, 5), (1, 1, 5), (0, 1, 5)],
            1: [(9, 9, 9), (1, 0, 9), (1, 1, 9), (0, 1, 9)],
        }
    }
    def BasisCurves "grass"
    {
    }
    def Camera "camera"
    {
    }"""
    mesh = load_mesh(usda(tmp_path / "a.usda", hidden + proxy + hole))
    np.testing.assert_array_equal(corners(mesh), [[[0, 0, 5], [1, 0, 5], [1, 1, 5]]])
    assert set(mesh.dropped) == {
        "animation; its first time is shown",
        "BasisCurves (1)",
        "Camera (1)",
        "subdivision; meshes are shown as stored",
    }


def test_instances_stand_where_they_are_placed(tmp_path: Path) -> None:
    usda(tmp_path / "part.usda", square())
    body = """
    def Xform "one" (
        instanceable = true
        references = @part.usda@
    )
    {
    }
    def Xform "two" (
        instanceable = true
        references = @./part.usda@
    )
    {
        double3 xformOp:translate = (10, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def "three" (references = </thing/two>)
    {
        double3 xformOp:translate:more = (5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:more"]
    }
    def PointInstancer "many"
    {
        rel prototypes = </thing/many/kind>
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 20, 0), (0, 30, 0)]
        def Xform "kind" (
            references = @part.usda@
        )
        {
            double3 xformOp:translate = (0, 1, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
    }"""
    mesh = load_mesh(usda(tmp_path / "a.usda", body))
    places = {tuple(each.min(axis=0)) for each in corners(mesh)}
    assert places == {(0, 0, 0), (10, 0, 0), (15, 0, 0), (0, 21, 0), (0, 31, 0)}
    assert len(mesh.triangles) == 10


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("Sphere", (2, 2, 2)),
        ("Cube", (2, 2, 2)),
        ("Cylinder", (2, 2, 2)),
        ("Cone", (2, 2, 2)),
        ("Capsule", (1, 1, 2)),
        ("Plane", (2, 2, 0)),
    ],
)
@pytest.mark.parametrize("axis", ["Z", "X", "Y"])
def test_solids(tmp_path: Path, kind: str, size: tuple[float, ...], axis: str) -> None:
    given = f'uniform token axis = "{axis}"' if kind not in ("Sphere", "Cube") else ""
    body = f'def {kind} "solid"\n{{\n{given}\n}}'
    mesh = load_mesh(usda(tmp_path / "a.usda", body))
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    turned = np.roll(size, " XYZ".index(axis))
    np.testing.assert_allclose(high - low, turned, atol=0.01)
    np.testing.assert_allclose(high + low, 0.0, atol=1e-5)
    triangles = mesh.positions[mesh.triangles]
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    if kind == "Plane":
        assert (normal[:, "XYZ".index(axis)] > 0).all()
    else:
        assert ((normal * triangles.mean(axis=1)).sum(axis=1) > 0).all()


def test_a_plane_is_wide_along_x_and_long_along_the_other(tmp_path: Path) -> None:
    for axis, size in (("X", (0, 3, 1)), ("Y", (1, 0, 3)), ("Z", (1, 3, 0))):
        body = f'def Plane "p"\n{{\nuniform token axis = "{axis}"\ndouble width = 1\n'
        mesh = load_mesh(usda(tmp_path / "a.usda", body + "double length = 3\n}"))
        extent = mesh.positions.max(axis=0) - mesh.positions.min(axis=0)
        np.testing.assert_allclose(extent, size)


def test_meshes_without_faces_are_nothing(tmp_path: Path) -> None:
    empty = 'def Mesh "points"\n{\npoint3f[] points = [(0, 0, 0)]\n}\ndef Mesh "none"\n{\n}'
    assert len(load_mesh(usda(tmp_path / "a.usda", empty + square())).triangles) == 2


def test_references_that_lead_nowhere_are_named(tmp_path: Path) -> None:
    body = square() + 'def "a" (references = </thing/nothing>)\n{\n}'
    mesh = load_mesh(usda(tmp_path / "a.usda", body))
    assert mesh.dropped == ("references that lead nowhere (1)",)


def test_subsets_have_their_materials(tmp_path: Path) -> None:
    def look(name: str, color: str) -> str:
        return f"""
    def Material "{name}"
    {{
        token outputs:surface.connect = </thing/{name}/s.outputs:surface>
        def Shader "s"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = {color}
            token outputs:surface
        }}
    }}"""

    body = (
        look("red", "(1, 0, 0)")
        + look("blue", "(0, 0, 1)")
        + """
    def Mesh "two" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        rel material:binding = </thing/red>
        def GeomSubset "part" (prepend apiSchemas = ["MaterialBindingAPI"])
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </thing/blue>
        }
    }"""
    )
    mesh = load_mesh(usda(tmp_path / "a.usda", body))
    found = {
        mesh.materials[index].albedo: mesh.positions[triangle].sum(axis=0).tolist()
        for index, triangle in zip(mesh.material_index, mesh.triangles, strict=True)
    }
    assert found == {(1, 0, 0): [2, 1, 0], (0, 0, 1): [1, 2, 0]}
