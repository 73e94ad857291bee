"""Objects drawn by rays look as drawn by OpenGL."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.bvh.scene import object_bounds
from iprt.compositing.object_layer import VisibleLayer
from iprt.compositing.visibility import Visibility
from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.geometry.material import Material, material_table
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Instance
from iprt.raster.layers import SAMPLES, ObjectLayers
from iprt.world.objects.object_bvh import ObjectBvh
from tests.compositing.layers import no_edges
from tests.kernels.tracing import panorama_of
from tests.oracles.worlds import Box, World
from tests.raster.shapes import mesh, placed, quad, rasterizer, sphere
from tests.worlds import Float, bright_walls, room_frame

pytestmark = pytest.mark.gl

VIEWS = [
    View(97, 71, yaw_deg=-4.0, pitch_deg=3.0, fov_y_deg=70.0),
    View(160, 80, projection="equirect"),
]
views = pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.projection)
ROOM = World(solids=(Box((0.3, -0.1, -1.0), (0.12, 0.3, 0.05)),))
"""A post stands in front of the first ball."""
PLANES = ("normal", "depth", "id", "roughness", "albedo", "coverage", "motion")


def image(device: ComputeDevice, layer: VisibleLayer, name: str) -> Float:
    """Return a plane of a layer, (H, W) or (H, W, C)."""
    height, width = layer.display.shape[1:3]
    planes = PlaneLayout(width, height).interior(device.read(getattr(layer, name)))
    channels = np.moveaxis(planes.astype(np.float64), 0, -1)
    return channels[..., 0] if channels.shape[-1] == 1 else channels


def layer_of(device: ComputeDevice, view: View, *materials: Material) -> VisibleLayer:
    edges, needs = no_edges(device, view), MaterialNeeds.of(materials)
    return VisibleLayer(device, PlaneLayout.of(view), edges, needs)


class Drawn:
    """An object that rays draw in a room, wherever it is."""

    def __init__(self, device: ComputeDevice, view: View, instance: Instance) -> None:
        self._device, self._view = device, view
        self._bvh = ObjectBvh(device, [instance])
        self._panorama = panorama_of(device, room_frame(World(), 64, 32, bright_walls))
        self._constants = device.upload("view", view.kernel_constants())
        self._table = device.upload("materials", material_table(instance.mesh.materials))
        self._instance = instance

    def visibility(self) -> Visibility:
        made = Visibility(self._device, self._view, self._bvh, [self._instance], SAMPLES)
        made.follow([self._instance])
        return made

    def run(self, instance: Instance, *shown: tuple[Visibility, VisibleLayer]) -> None:
        self._bvh.load([instance])
        bounds = object_bounds([instance], margin=1e-3)
        boxes, now = self._device.upload("boxes", bounds), self._constants
        for visibility, layer in shown:
            world = self._panorama, bounds, boxes, self._table
            visibility.run(layer, self._view, now, now, *world)


def pattern() -> Material:
    """Smooth over a few pixels, so that ways to filter it hardly differ."""
    y, x = np.mgrid[0:64, 0:64] * (2.0 * np.pi / 64.0)
    waves = 0.5 + 0.4 * np.stack([np.sin(x), np.cos(y), np.sin(x + y)], axis=-1)
    return Material(texture=waves.astype(np.float32), albedo=(0.9, 0.8, 0.7))


def scene(picture: Material) -> list[Instance]:
    tilted = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    return [
        placed(sphere(4), (0.35, -0.1, -1.3), 0.4, name="ball"),
        placed(quad((picture,)), (-0.5, 0.1, -1.5), (-0.35, 0.3, 0.3), tilted, name="picture"),
        placed(sphere(2), (-0.2, -0.1, 1.5), (0.3, 0.2, -0.1), name="behind, over the seam"),
        placed(mesh(np.zeros((0, 3)), np.zeros((0, 3), int)), name="nothing"),
        placed(sphere(1), (0.05, 0.9, 0.02), 0.1, name="overhead"),
    ]


def moved(instances: list[Instance]) -> list[Instance]:
    turn = np.eye(4)
    turn[:3, :3] = View(1, 1, 20.0, 10.0).world_from_view
    turn[0, 3] = 0.05
    return [replace(i, to_world=turn @ i.to_world) for i in instances[:1]] + instances[1:]


class Both:
    """The visible layer of the same scene by OpenGL and by rays."""

    def __init__(
        self, device: ComputeDevice, view: View, picture: Material, samples: int = SAMPLES
    ) -> None:
        """`samples`: a side of a pixel, by which rays find coverage."""
        instances = scene(picture)
        before = moved(instances)
        panorama = panorama_of(device, room_frame(ROOM, 250, 125, bright_walls))  # no ties
        turned = view
        if view.projection == "perspective":
            turned = replace(view, yaw_deg=view.yaw_deg + 3.0, fov_y_deg=65.0)
        now, then = (device.upload("view", v.kernel_constants()) for v in (view, turned))
        materials = [m for i in instances for m in i.mesh.materials]
        table = device.upload("materials", material_table(materials))
        self.drawn = layer_of(device, view, picture)
        self.traced = layer_of(device, view, picture)
        with rasterizer(before) as opened:
            opened.set_surface(device.read(panorama.surface))
            opened.move(instances)
            self.layers = opened.render(view, turned, shade=True)
        self.drawn.load(self.layers, now, table)
        bvh = ObjectBvh(device, before)
        visibility = Visibility(device, view, bvh, before, samples)
        visibility.follow(before)
        bvh.load(before)
        bvh.load(instances)
        visibility.follow(instances)
        bounds = object_bounds(instances, margin=1e-3)
        boxes = device.upload("boxes", bounds)
        visibility.run(self.traced, view, now, then, panorama, bounds, boxes, table)
        self._device, self.view, self.loading = device, view, (now, table)

    def images(self, name: str) -> tuple[Float, Float]:
        return image(self._device, self.drawn, name), image(self._device, self.traced, name)


@pytest.fixture(scope="module", params=VIEWS, ids=lambda view: view.projection)
def both(device: ComputeDevice, request: pytest.FixtureRequest) -> Both:
    return Both(device, request.param, pattern())


def inner(ids: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Pixels whose neighbours all show the same, columns of the whole panorama apart."""
    same = ids > 0.0
    for y in (-1, 0, 1):
        for x in (-1, 0, 1):
            same &= np.roll(ids, (y, x), (0, 1)) == ids
    same[[0, -1]] = same[:, [0, -1]] = False
    return np.asarray(same)


def test_ids(both: Both) -> None:
    drawn, traced = both.images("id")
    assert {1, 2} <= set(np.unique(drawn))
    differ = drawn != traced
    assert not differ[inner(drawn)].any()
    assert differ.sum() <= 0.01 * (drawn > 0.0).sum()


def test_depth_normals_and_roughness(both: Both) -> None:
    same = inner(both.images("id")[0])
    assert same.sum() > 300
    for name, tolerance in (("depth", 1e-5), ("normal", 1e-4), ("roughness", 1e-6)):
        drawn, traced = both.images(name)
        error = np.abs(drawn - traced).reshape(*same.shape, -1).max(-1)[same]
        # Next to an edge between two triangles either may be seen.
        assert np.percentile(error, 99) < tolerance
        assert error.max() < 0.2


def test_normals_that_face_away_are_mirrored_about_the_silhouette(
    device: ComputeDevice, both: Both
) -> None:
    assert both.layers.display is not None
    layers = ObjectLayers.displayed(both.layers.display.copy(), both.layers.back)
    d = both.view.directions()
    front = layers.front.geometry
    tilted = front[..., :3] + 0.8 * d
    tilted /= np.maximum(np.linalg.norm(tilted, axis=-1, keepdims=True), 1e-9)
    front[..., :3] = np.where(front[..., 3:] > 0.0, tilted, 0.0)
    layer = layer_of(device, both.view)
    layer.load(layers, *both.loading)
    normal, covered = image(device, layer, "normal"), image(device, layer, "coverage") > 0.0
    off = np.maximum((tilted * d).sum(-1, keepdims=True), 0.0)
    assert (covered & (off[..., 0] > 0.0)).sum() > 60
    np.testing.assert_allclose(normal[covered], (tilted - 2.0 * off * d)[covered], atol=1e-5)


def test_albedo_with_textures(both: Both) -> None:
    drawn, traced = both.images("albedo")
    same = inner(both.images("id")[0])
    assert np.ptp(drawn[..., 0][same]) > 0.3
    assert np.abs(drawn - traced)[same].max() < 0.06
    assert np.abs(drawn - traced)[same].mean() < 5e-3


@views
def test_finish_with_textures(device: ComputeDevice, view: View) -> None:
    """Its map has the values of the albedo's, so that one is known from the other."""
    colored = pattern()
    assert colored.texture is not None
    both = Both(
        device,
        view,
        replace(
            colored,
            kind="principled",
            alpha=0.64,
            metallic=0.5,
            surface_texture=np.ascontiguousarray(colored.texture[..., :2]),
        ),
    )
    ids = both.images("id")[0]
    picture = inner(ids) & (ids == 2.0)
    assert picture.sum() > 60
    scale = both.images("albedo")[0][picture] / np.array(colored.albedo)
    expected = {"metallic": 0.5 * scale[:, 0], "roughness": 0.64 * scale[:, 1] ** 2}
    for name, values in expected.items():
        assert np.ptp(values) > 0.2
        for found in both.images(name):
            np.testing.assert_allclose(found[picture], values, atol=0.03)
    for name, value in (("metallic", 0.0), ("roughness", 1.0)):
        for found in both.images(name):
            np.testing.assert_array_equal(found[ids == 1.0], value)


@views
def test_emission_with_textures(device: ComputeDevice, view: View) -> None:
    colored = pattern()
    glowing = replace(colored, emission=(7.0, 0.5, 30.0), emission_texture=colored.texture)
    both = Both(device, view, glowing)
    ids = both.images("id")[0]
    picture = inner(ids) & (ids == 2.0)
    assert picture.sum() > 60
    for found, albedo in zip(both.images("emission"), both.images("albedo"), strict=True):
        scale = albedo[picture] / np.array(colored.albedo)
        np.testing.assert_allclose(found[picture] / glowing.emission, scale, atol=1e-3)
        np.testing.assert_array_equal(found[ids == 1.0], 0.0)


def drawn_and_traced(
    device: ComputeDevice, view: View, instance: Instance
) -> tuple[VisibleLayer, VisibleLayer]:
    """Return the layers of one object in a room."""
    panorama = panorama_of(device, room_frame(World(), 64, 32, bright_walls))
    constants = device.upload("view", view.kernel_constants())
    materials = instance.mesh.materials
    table = device.upload("materials", material_table(materials))
    drawn, traced = layer_of(device, view, *materials), layer_of(device, view, *materials)
    with rasterizer([instance]) as opened:
        opened.set_surface(device.read(panorama.surface))
        drawn.load(opened.render(view, shade=True), constants, table)
    bvh = ObjectBvh(device, [instance])
    bvh.load([instance])
    visibility = Visibility(device, view, bvh, [instance], SAMPLES)
    visibility.follow([instance])
    bounds = object_bounds([instance], margin=1e-3)
    boxes = device.upload("boxes", bounds)
    visibility.run(traced, view, constants, constants, panorama, bounds, boxes, table)
    return drawn, traced


@views
@pytest.mark.parametrize("mirrored", [False, True])
def test_normal_maps(device: ComputeDevice, view: View, mirrored: bool) -> None:
    """A map of one direction tilts the normal of the square along u, v and its own."""
    tilt = np.float32([0.3, 0.5, 0.8])
    material = Material(normal_texture=np.tile(tilt, (4, 4, 1)))
    along_u = np.tile([1.0, 0.0, 0.0, 1.0], (4, 1)).astype(np.float32)
    square = replace(quad((material,)), tangents=along_u)
    turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    u, v, n = turn.T
    if mirrored:
        u, turn = -u, turn * [-1.0, 1.0, 1.0]
    instance = placed(square, (-0.2, 0.0, -1.5), 0.5, turn)
    expected = tilt[0] * u + tilt[1] * v + tilt[2] * n
    expected /= np.linalg.norm(expected)
    for layer in drawn_and_traced(device, view, instance):
        seen = image(device, layer, "coverage") == 1.0
        assert seen.sum() > 200
        # Where the tilted normal faces away, it is turned to the viewer.
        facing = seen & (view.directions() @ expected < -0.05)
        assert facing.sum() > 100
        normals = image(device, layer, "normal")[facing]
        np.testing.assert_allclose(normals, np.tile(expected, (len(normals), 1)), atol=2e-3)


def test_coverage(both: Both) -> None:
    drawn, traced = both.images("coverage")
    assert ((drawn > 0.0) & (drawn < 1.0)).sum() > 50
    assert np.abs(drawn - traced).max() <= 2.01 / 16.0
    assert (drawn != traced).sum() < 0.05 * (drawn > 0.0).sum()
    assert ((drawn == 0.0) & (both.layers.front.geometry[..., 3] > 0.0)).sum() > 10  # the post


def test_silhouettes(device: ComputeDevice, both: Both) -> None:
    """They include objects behind the post, which coverage lacks."""
    drawn, traced = (device.read(layer.display)[2] for layer in (both.drawn, both.traced))
    assert np.abs(drawn - traced)[..., 3].max() <= 2.01 / 16.0
    assert ((drawn != traced)[..., 3]).sum() < 0.05 * (drawn[..., 3] > 0.0).sum()
    for display in (drawn, traced):
        assert (display[..., 3] >= display[..., 0]).all()
        assert ((display[..., 3] == 1.0) & (display[..., 0] == 0.0)).sum() > 10


@views
def test_coverage_is_the_same_without_textures(device: ComputeDevice, view: View) -> None:
    """Most rays are then not sent through the hierarchy."""
    textured, plain = (
        Both(device, view, picture).images("coverage")[1] for picture in (pattern(), Material())
    )
    np.testing.assert_array_equal(plain, textured)


@views
def test_few_samples_are_taken_along_outlines_alone(device: ComputeDevice, view: View) -> None:
    """With textures they are taken everywhere, and show the same."""
    textured, plain = (
        Both(device, view, picture, 2).images("coverage")[1] for picture in (pattern(), Material())
    )
    assert ((textured > 0.0) & (textured < 1.0)).sum() > 50
    differ = textured != plain
    assert differ.sum() <= 0.001 * (textured > 0.0).sum()


def test_borrowed_edges(both: Both) -> None:
    ids = both.images("id")
    centre = both.layers.back.geometry[..., 3] > 0.0
    lent = (ids[0] > 0.0) & ~centre & (ids[0] == ids[1])
    assert lent.sum() > 20
    for name in ("depth", "normal", "albedo"):
        drawn, traced = both.images(name)
        assert np.percentile(np.abs(drawn - traced)[lent], 95) < 0.02


def test_motion(both: Both) -> None:
    same = inner(both.images("id")[0])
    drawn, traced = both.images("motion")
    np.testing.assert_allclose(traced[same], drawn[same], atol=2e-3)
    pixels = np.indices(same.shape)[::-1].transpose(1, 2, 0) + 0.5
    assert np.abs(drawn - pixels)[same].max() > 3.0


@pytest.mark.parametrize("side", [-1, 1])
def test_an_edge_on_the_seam_borrows_across_it(device: ComputeDevice, side: int) -> None:
    """A ball reaches a quarter of a pixel over the seam: there only the pixel across can lend."""
    view = View(160, 80, projection="equirect")
    radius = 0.2
    azimuth = side * (np.pi + 0.25 * 2.0 * np.pi / view.width - radius)
    centre = 1.5 * np.array([np.sin(azimuth), 0.0, -np.cos(azimuth)])
    ball = placed(sphere(4), tuple(centre), 1.5 * np.sin(radius))
    drawn, layer = Drawn(device, view, ball), layer_of(device, view)
    drawn.run(ball, (drawn.visibility(), layer))
    coverage, depth = image(device, layer, "coverage"), image(device, layer, "depth")
    beyond, before = (0, -1) if side > 0 else (-1, 0)
    assert (coverage[39:41, before] > 0.9).all()
    assert ((coverage[39:41, beyond] > 0.1) & (coverage[39:41, beyond] < 0.5)).all()
    assert (depth[39:41, beyond] > 1.2).all()


@views
def test_rectangles_that_are_filled_anew_leave_nothing_of_the_last_run(
    device: ComputeDevice, view: View
) -> None:
    """Objects that jump, vanish and come back, beside one that each time starts from nothing."""
    ball = placed(sphere(2), (0.0, 0.0, -2.0), 0.3)
    drawn = Drawn(device, view, ball)
    kept = drawn.visibility(), layer_of(device, view)
    # The room ends before the farthest place.
    for x, z in ((0.0, -2.0), (0.7, -1.5), (0.0, 2.0), (-0.4, -1.2), (0.0, -500.0), (0.3, -2.0)):
        there = replace(ball, to_world=placed(sphere(2), (x, 0.1, z), 0.3).to_world)
        fresh = drawn.visibility(), layer_of(device, view)
        drawn.run(there, kept, fresh)
        for name in PLANES:
            np.testing.assert_array_equal(
                *(image(device, layer, name) for _, layer in (kept, fresh)), err_msg=name
            )
        in_sight = z > -100.0 and (z < 0.0 or view.projection == "equirect")
        for name in ("coverage", "id"):
            assert image(device, kept[1], name).any() == in_sight
        for name in ("front", "material"):
            np.testing.assert_array_equal(
                *(device.read(getattr(visibility, name)) for visibility, _ in (kept, fresh))
            )
