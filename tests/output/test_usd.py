"""Scenes as USD stages: the same triangles, materials, rays, directions and times as in iprt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt.footage.depth_mesh import depth_mesh
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.keyframes import ObjectMotion
from iprt.geometry.light import Light
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh, transformed
from iprt.geometry.meshes import load_mesh
from iprt.geometry.variants import Variants
from iprt.scene.objects import SceneObject
from iprt.scene.scene import Scene
from tests.geometry.usd_files import corners, in_this_process  # noqa: F401
from tests.scene.files import CUBE, MANIFEST, VIEW, box_room, write_channels, write_scene

pytest.importorskip("pxr", reason="needs the extra `usd`")
from pxr import Usd, UsdGeom, UsdLux, UsdShade

from iprt.output.usd.lights import write_dome, write_light, write_sun
from iprt.output.usd.materials import MaterialWriter
from iprt.output.usd.objects import write_objects
from iprt.output.usd.pictures import Pictures
from iprt.output.usd.stage import write_scene as write_stage

pytestmark = pytest.mark.usefixtures("in_this_process")

PLACED = "[0.1, 0, 0, 0.5, 0, 0, -0.1, -0.8, 0, 0.1, 0, -1.5, 0, 0, 0, 1]"
SUN = "sun = { direction = [1, 2, -1], irradiance = [3, 2, 1] }\n"
MOVING = f"""
[[objects]]
name = "a cube"
mesh = "cube.obj"
to_world = {PLACED}
keyframes = [{{ time = 0, translation = [0, 0, 0] }}, {{ time = 0.2, translation = [0.2, 0, 0] }}]

[[views]]
name = "ahead"
size = [32, 24]
yaw_deg = 20
pitch_deg = -10
fov_y_deg = 50
keyframes = [{{ time = 0, fov_y_deg = 50 }}, {{ time = 0.2, fov_y_deg = 30 }}]
"""


@pytest.fixture
def room(tmp_path: Path) -> Scene:
    """A box room with a hole in its depth, that moves in three frames."""
    video = MANIFEST.replace(".exr", ".%d.exr") + "frames = [4, 6]\nfps = 10\n" + SUN
    folder = write_scene(tmp_path / "room", video + MOVING)
    depth, _ = box_room(64, 32)
    depth[14:18, 20:26] = 0.0
    rng = np.random.default_rng(2)
    for number in (4, 5, 6):
        write_channels(folder / f"depth.{number}.exr", Z=depth.astype(np.float32))
        color = rng.uniform(0.0, 4.0, (32, 64, 3)).astype(np.float32)
        write_channels(
            folder / f"color.{number}.exr", R=color[..., 0], G=color[..., 1], B=color[..., 2]
        )
    return Scene.open(folder)


@pytest.fixture
def stage(room: Scene, tmp_path: Path) -> Usd.Stage:
    write_stage(room, tmp_path / "out" / "room.usda", 5, (64, 32))
    return Usd.Stage.Open(str(tmp_path / "out" / "room.usda"))


def test_objects_come_back_as_the_same_triangles(
    stage: Usd.Stage, room: Scene, tmp_path: Path
) -> None:
    stage.GetPrimAtPath("/box/captured").SetActive(False)
    stage.Export(str(tmp_path / "objects.usda"))
    (instance,) = room.instances_at(0.0)
    points = transformed(instance.to_world, instance.mesh.positions)
    here = Mesh(**{**vars(instance.mesh), "positions": points.astype(np.float32)})
    back = load_mesh(tmp_path / "objects.usda")
    np.testing.assert_allclose(corners(back), corners(here), atol=2e-5)
    assert back.materials[0].kind == "diffuse"


def test_points_of_the_surfaces_lie_on_the_rays_of_their_texels(
    stage: Usd.Stage, room: Scene
) -> None:
    frame = room.frame(5)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/box/captured/surfaces"))
    points = np.array(mesh.GetPointsAttr().Get())
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get()).reshape(-1, 3, 2)
    seen = equirect_pixel(points[indices].astype(np.float64), 64, 32)
    inner = indices < 64 * 32
    ahead = np.abs((st[..., 0] * 64 - seen[..., 0] + 32) % 64 - 32)
    assert ahead[inner].max() < 1e-3
    np.testing.assert_allclose(((1 - st[..., 1]) * 32)[inner], seen[inner][:, 1], atol=1e-3)
    assert np.ptp(st[..., 0], axis=1).max() < 0.1, "no triangle spans the picture at the seam"
    assert st[..., 0].max() > 1.0
    distance = np.linalg.norm(points[: 64 * 32], axis=1)
    there = np.unique(indices[inner])
    np.testing.assert_allclose(distance[there], frame.depth.ravel()[there], rtol=1e-5)
    hole = np.zeros((32, 64), bool)
    hole[14:18, 20:26] = True
    assert not hole.ravel()[there].any(), "windows stay open"
    a, b, c = np.moveaxis(points[indices], 1, 0)
    assert (np.einsum("ij,ij->i", a, np.cross(b - a, c - a)) < 0).all(), "faces look inwards"


def test_the_camera_of_the_video_moves(tmp_path: Path, room: Scene) -> None:
    poses = [np.eye(4) for _ in range(3)]
    poses[1][:3, :3] = View(1, 1, yaw_deg=90.0).world_from_view
    poses[1][:3, 3], poses[2][:3, 3] = (0.1, 0.2, 0.3), (0.4, 0.0, 0.0)
    rows = [" ".join(map(str, pose.ravel())) for pose in poses]
    (room.root / "poses.txt").write_text("\n".join(rows))
    manifest = room.root / "scene.toml"
    manifest.write_text(manifest.read_text().replace("fps = 10", 'fps = 10\nposes = "poses.txt"'))
    write_stage(Scene.open(room.root), tmp_path / "moved.usda", 5, (16, 8))
    stage = Usd.Stage.Open(str(tmp_path / "moved.usda"))
    views, captured = (
        UsdGeom.Xformable(stage.GetPrimAtPath(f"/box/{name}")) for name in ("views", "captured")
    )
    for code, pose in zip((4, 5, 6), poses, strict=True):
        np.testing.assert_allclose(np.array(views.GetLocalTransformation(code)).T, pose, atol=1e-9)
        surfaces = np.array(captured.GetLocalTransformation(code)).T
        np.testing.assert_allclose(surfaces, poses[1], atol=1e-9)


def test_a_smaller_grid_has_exact_points(room: Scene) -> None:
    frame = room.frame(5)
    mesh = depth_mesh(frame, (20, 9))
    directions = View(64, 32, projection="equirect").directions()
    texels = np.ix_(mesh.rows, mesh.columns)
    expected = (directions * frame.depth[..., None])[texels].reshape(-1, 3)
    np.testing.assert_allclose(mesh.positions[:-2], expected, atol=1e-6)
    assert (len(mesh.rows), len(mesh.columns)) == (9, 20)
    assert mesh.triangles.max() < len(mesh.positions)


def seen_by_dome(dome: UsdLux.DomeLight, direction: np.ndarray) -> tuple[float, float]:
    """Return column and row, from 0 to 1, by OpenEXR's convention for latitude-longitude maps.

    Longitude 0 is +Z, in the middle; +pi/2 is +X, left of it; latitude +pi/2 is +Y, at the top.
    """
    to_world = np.array(UsdGeom.Xformable(dome).GetLocalTransformation()).T[:3, :3]
    x, y, z = to_world.T @ direction
    return 0.5 - np.arctan2(x, z) / (2 * np.pi), 0.5 - np.arcsin(y) / np.pi


@pytest.mark.parametrize(
    "direction",
    [(0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0.6, 0.48, -0.64), (-0.8, 0, 0.6)],
)
def test_the_dome_shows_the_panorama_where_it_is(direction: tuple[float, ...]) -> None:
    stage = Usd.Stage.CreateInMemory()
    write_dome(stage, "/dome", "./panorama.exr")
    dome = UsdLux.DomeLight(stage.GetPrimAtPath("/dome"))
    column, row = seen_by_dome(dome, np.array(direction, np.float64))
    x, y = equirect_pixel(np.array(direction, np.float64), 1, 1)
    assert row == pytest.approx(y)
    if abs(direction[1]) < 1:
        assert column == pytest.approx(x)


def test_the_sun_shines_from_its_direction() -> None:
    stage = Usd.Stage.CreateInMemory()
    towards = np.array([0.48, 0.6, 0.64])
    write_sun(stage, "/sun", Sun(towards, (3.0, 1.5, 0.0)))
    light = UsdLux.DistantLight(stage.GetPrimAtPath("/sun"))
    to_world = np.array(UsdGeom.Xformable(light).GetLocalTransformation()).T[:3, :3]
    np.testing.assert_allclose(to_world @ (0, 0, -1), -towards, atol=1e-12)
    assert light.GetNormalizeAttr().Get()
    irradiance = light.GetIntensityAttr().Get() * np.array(light.GetColorAttr().Get())
    np.testing.assert_allclose(irradiance, [3.0, 1.5, 0.0])


def test_views_and_motion(stage: Usd.Stage, room: Scene) -> None:
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (4, 6)
    assert stage.GetTimeCodesPerSecond() == 10
    moved = UsdGeom.Xformable(stage.GetPrimAtPath("/box/objects/a_cube"))
    prim = stage.GetPrimAtPath("/box/views/ahead")
    for code, seconds in ((4, 0.0), (5, 0.1), (6, 0.2)):
        (instance,) = room.instances_at(seconds)
        found = np.array(moved.GetLocalTransformation(code)).T
        np.testing.assert_allclose(found, instance.to_world, atol=1e-12)
        camera = UsdGeom.Camera(prim).GetCamera(code)
        view = room.views["ahead"].at(seconds)
        assert camera.GetFieldOfView(camera.FOVVertical) == pytest.approx(view.fov_y_deg, rel=1e-4)
        assert camera.aspectRatio == pytest.approx(32 / 24)
        rotation = np.array(camera.transform).T[:3, :3]
        np.testing.assert_allclose(rotation, view.world_from_view, atol=1e-12)
    still = np.array(moved.GetLocalTransformation()).T
    np.testing.assert_allclose(still, room.instances_at(0.1)[0].to_world, atol=1e-12)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert stage.GetPrimAtPath("/box/sun").IsValid()


TEXELS = np.random.default_rng(1).uniform(0, 1, (4, 8, 3)).astype(np.float32)
MASK = np.linspace(0.0, 1.0, 32, dtype=np.float32).reshape(4, 8)
RED = (0.5, 0.1, 0.1)
MATERIALS = [
    Material("diffuse", (0.5, 0.25, 0.125)),
    Material("plastic", (0.5, 0.25, 0.125), alpha=0.09, ior=1.4),
    Material("principled", (0.5, 0.25, 0.125), alpha=0.25, metallic=0.5),
    Material("principled", (1, 1, 1), alpha=0.25, metallic=1.0, surface_texture=TEXELS[..., :2]),
    Material("principled", RED, alpha=0.25, ior=1.4, clearcoat=0.75, clearcoat_alpha=0.04),
    Material("dielectric", (0.9, 1, 0.9), alpha=0.0, ior=1.33),
    Material("diffuse", (1, 1, 1), texture=TEXELS, opacity_texture=MASK, cutoff=0.5),
    Material("diffuse", (0.5, 0.5, 0.5), opacity=0.5),
    Material("plastic", (0.5, 0.5, 0.5), emission=(8, 4, 2), emission_texture=TEXELS),
]


@pytest.mark.parametrize("material", MATERIALS, ids=range(len(MATERIALS)))
def test_materials_come_back(tmp_path: Path, material: Material) -> None:
    (tmp_path / "cube.obj").write_text(CUBE)
    mesh = load_mesh(tmp_path / "cube.obj", material)
    stage = Usd.Stage.CreateInMemory()
    writer = MaterialWriter(stage, "/materials", Pictures(tmp_path / "pictures"))
    entry = SceneObject("cube", mesh, ObjectMotion(np.diag([100.0, 100, 100, 1])))
    write_objects(stage, "/objects", [entry], writer, 0.0, ())
    stage.GetRootLayer().Export(str(tmp_path / "cube.usda"))
    back = load_mesh(tmp_path / "cube.usda")
    (found,) = back.materials
    assert writer.lost == {}
    assert back.dropped == ()
    assert found.kind == material.kind
    numbers = "albedo emission alpha metallic opacity cutoff transmission clearcoat clearcoat_alpha"
    for name in numbers.split():
        if name != "alpha" or material.kind != "diffuse":
            assert getattr(found, name) == pytest.approx(getattr(material, name), abs=1e-6), name
    if material.kind in ("plastic", "dielectric"):
        assert found.ior == pytest.approx(material.ior)
    for name in ("texture", "surface_texture", "opacity_texture", "emission_texture"):
        wanted, got = getattr(material, name), getattr(found, name)
        assert (wanted is None) == (got is None), name
        if wanted is not None:
            np.testing.assert_allclose(got, wanted, atol=0.006)


def test_maps_of_layers_are_lost(tmp_path: Path) -> None:
    """Their means are written, and the loss is named."""
    maps = Variants(("clearcoat",), ((0.5,), (1.0,)), np.array([[0, 1]], np.uint8))
    material = Material("principled", RED, clearcoat=0.75, variants=maps)
    stage = Usd.Stage.CreateInMemory()
    writer = MaterialWriter(stage, "/materials", Pictures(tmp_path / "pictures"))
    surface = UsdShade.Shader(writer.of(material, "coat").GetPrim().GetChild("surface"))
    assert surface.GetInput("clearcoat").Get() == 0.75
    assert [*writer.lost] == ["maps of clearcoat, sheen, tint and transmission; means are used"]


@pytest.mark.parametrize("above", [None, 0.25, 0.5])
def test_normals_of_clear_coats_are_named(tmp_path: Path, above: float | None) -> None:
    """Unless the surface below has the same."""
    below = np.float32([[[0.5, 0.0, 1.0]]])
    coat = None if above is None else np.float32([[[above, 0.0, 1.0]]])
    material = Material("principled", RED, clearcoat=0.75, normal_texture=below)
    material = replace(material, clearcoat_normal_texture=coat)
    stage = Usd.Stage.CreateInMemory()
    writer = MaterialWriter(stage, "/materials", Pictures(tmp_path / "pictures"))
    writer.of(material, "coat")
    lost = "normals of clear coats, which become the base normals"
    assert [*writer.lost] == ([] if above == 0.5 else [lost])


def test_several_materials_are_subsets(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(CUBE)
    mesh = load_mesh(tmp_path / "cube.obj")
    both = (Material("diffuse", (1, 0, 0)), Material("diffuse", (0, 0, 1)))
    mesh = Mesh(**{**vars(mesh), "materials": both, "material_index": np.arange(12) // 6})
    stage = Usd.Stage.CreateInMemory()
    writer = MaterialWriter(stage, "/materials", Pictures(tmp_path / "pictures"))
    objects = [SceneObject("cube", mesh, ObjectMotion(np.eye(4)))] * 2
    write_objects(stage, "/objects", objects, writer, 0.0, ())
    assert len(stage.GetPrimAtPath("/materials").GetChildren()) == 2, "materials are shared"
    stage.GetRootLayer().Export(str(tmp_path / "two.usda"))
    back = load_mesh(tmp_path / "two.usda")
    reds = [back.materials[index].albedo == (1, 0, 0) for index in back.material_index]
    assert sum(reds) == 12
    assert len(reds) == 24
    assert UsdShade.Material(stage.GetPrimAtPath("/materials/cube_0"))


def test_a_still_without_objects_and_sun(tmp_path: Path) -> None:
    scene = Scene.open(write_scene(tmp_path / "still", MANIFEST + VIEW))
    assert write_stage(scene, tmp_path / "still.usdc", 0, (16, 8)) == []
    stage = Usd.Stage.Open(str(tmp_path / "still.usdc"))
    assert not stage.HasAuthoredTimeCodeRange()
    assert not stage.GetPrimAtPath("/box/sun").IsValid()


@pytest.mark.parametrize(
    "light",
    [
        Light("sphere", (2.0, 1.0, 0.5), radius=0.1),
        Light("sphere", (2.0, 1.0, 0.5)),
        Light("sphere", (2.0, 1.0, 0.5), cone_deg=(15.0, 30.0)),
        Light("rectangle", (2.0, 1.0, 0.5), size=(0.5, 0.2)),
        Light("sun", (2.0, 1.0, 0.5)),
    ],
)
def test_lights_have_the_intensity_of_their_area(light: Light) -> None:
    """The radiance of a normalized light is its intensity over its area (UsdLuxLightAPI)."""
    stage = Usd.Stage.CreateInMemory()
    later = np.eye(4)
    later[:3, 3] = 1.0, 2.0, 3.0
    write_light(stage, "/light", light, np.eye(4), [(5, later)])
    prim = stage.GetPrimAtPath("/light")
    written = UsdLux.LightAPI(prim)
    assert written.GetNormalizeAttr().Get()
    strength = written.GetIntensityAttr().Get() * np.array(written.GetColorAttr().Get())
    if light.kind == "sphere":
        radius = UsdLux.SphereLight(prim).GetRadiusAttr().Get()
        radiance = strength / (4.0 * np.pi * radius**2)
        np.testing.assert_allclose(radiance * np.pi * radius**2, light.intensity, rtol=1e-6)
        assert UsdLux.SphereLight(prim).GetTreatAsPointAttr().Get() == (light.radius == 0.0)
    else:
        np.testing.assert_allclose(strength, light.intensity, rtol=1e-6)
    if light.cone_deg is not None:
        shaping = UsdLux.ShapingAPI(prim)
        assert shaping.GetShapingConeAngleAttr().Get() == 30.0
        assert shaping.GetShapingConeSoftnessAttr().Get() == 0.5
    there = UsdGeom.XformCache(5).GetLocalToWorldTransform(prim).ExtractTranslation()
    assert tuple(there) == (1.0, 2.0, 3.0)
