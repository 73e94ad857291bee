"""Front and back layers against a brute-force ray caster, in both projections."""

from __future__ import annotations

import gc
from collections.abc import Sequence

import moderngl
import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from iprt.raster.layers import ObjectLayers
from tests.meshes import mesh_of
from tests.oracles.raster import Hits, Soup, cast_view, gather
from tests.raster.shapes import direction, mesh, placed, quad, rasterizer, sphere

pytestmark = pytest.mark.gl

EQUIRECT = [
    View(97, 49, projection="equirect"),
    View(64, 33, yaw_deg=37.0, pitch_deg=-25.0, projection="equirect"),
]
PERSPECTIVE = [
    View(65, 47, yaw_deg=20.0, pitch_deg=-10.0, fov_y_deg=70.0),
    View(33, 71, yaw_deg=-160.0, pitch_deg=35.0, fov_y_deg=110.0),
]


def render(instances: Sequence[Instance], view: View, shade: bool = False) -> ObjectLayers:
    with rasterizer(instances) as opened:
        return opened.render(view, shade=shade)


def check_layer(
    layer, soup: Soup, hits: Hits, steady, materials, min_compared: int, view: View
) -> None:
    """`layer` shows `hits`, except where a ray passes within the raster grid of an edge.

    Normals are on the side of the triangle that is seen.
    """
    seen = layer.geometry[..., 3] > 0.0
    assert ((hits.triangle >= 0) == seen)[steady].all()
    compared = steady & seen
    assert compared.sum() >= min_compared
    triangle, weights = hits.triangle[compared], hits.weights[compared]

    error = np.abs(layer.geometry[compared][:, 3] / hits.distance[compared] - 1.0)
    assert (error * hits.cosine[compared]).max() < 1e-6
    assert error[hits.cosine[compared] > 0.1].max() < 1e-5

    blended = np.einsum("nk,nkc->nc", weights, soup.normals[triangle])
    corners = soup.corners[triangle]
    plane = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen_from = np.einsum("nc,nc->n", plane, view.directions()[compared])
    turned = seen_from * np.einsum("nc,nc->n", plane, blended) > 0.0
    blended = np.where(turned[:, None], -blended, blended)
    length = np.linalg.norm(blended, axis=-1, keepdims=True)
    # Where the normal lies in the plane, either side may be the seen one.
    rise = np.abs(np.einsum("nc,nc->n", plane, blended)) / np.linalg.norm(plane, axis=-1)
    clear = (length[:, 0] > 0.1) & (rise > 1e-3) & (hits.cosine[compared] > 0.1)
    np.testing.assert_allclose(
        layer.geometry[compared][clear, :3], (blended / length)[clear], atol=2e-3
    )
    np.testing.assert_array_equal(layer.material[compared][:, 3], 1 + soup.material[triangle])
    albedo = np.array([m.albedo for m in materials], np.float32)[soup.material[triangle]]
    np.testing.assert_allclose(layer.material[compared][:, :3], albedo, atol=1e-6)


def check(instances: Sequence[Instance], *views: View, min_compared: int) -> list[ObjectLayers]:
    """Both layers of each view against the oracle; returns them."""
    soup = gather(instances)
    with rasterizer(instances) as opened:
        rendered = [opened.render(view, shade=False) for view in views]
        for view, layers in zip(views, rendered, strict=True):
            check_layers(layers, soup, view, opened.materials, min_compared)
    return rendered


def check_layers(layers: ObjectLayers, soup: Soup, view: View, materials, min_compared) -> None:
    nudge = 0.01 if view.projection == "perspective" else 1e-3
    first, steady = cast_view(soup, view, nudge=nudge)
    last, steady_last = cast_view(soup, view, away_only=True, nudge=nudge)
    # Without a surface that faces away, the back is the front.
    open_ended = (last.triangle < 0) & (first.triangle >= 0)
    back = Hits(
        np.where(open_ended, first.triangle, last.triangle),
        np.where(open_ended, first.distance, last.distance),
        np.where(open_ended[..., None], first.weights, last.weights),
        np.where(open_ended, first.cosine, last.cosine),
    )
    check_layer(layers.front, soup, first, steady, materials, min_compared, view)
    check_layer(layers.back, soup, back, steady & steady_last, materials, min_compared, view)
    for layer in (layers.front, layers.back):
        empty = layer.geometry[..., 3] == 0.0
        assert not layer.geometry[empty].any()
        assert not layer.material[empty].any()


def soup_mesh(seed: int, count: int = 60) -> Mesh:
    """Random triangles of all sizes all around the capture centre."""
    rng = np.random.default_rng(seed)
    centre = rng.normal(size=(count, 1, 3)) * 2.0
    corners = centre + rng.normal(size=(count, 3, 3)) * rng.choice([0.05, 0.4, 2.0], (count, 1, 1))
    normals = rng.normal(size=(3 * count, 3))
    materials = tuple(Material(albedo=tuple(rng.random(3))) for _ in range(3))
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return mesh_of(corners, np.arange(3 * count), materials, unit)


def test_random_triangles() -> None:
    """Also: two instances, one mirrored and sheared; materials number across instances."""
    shear = np.array([[-1.0, 0.3, 0.0], [0.0, 0.8, 0.1], [0.2, 0.0, 1.3]])
    instances = [placed(soup_mesh(1)), placed(soup_mesh(2), (0.1, -0.2, 0.3), rotation=shear)]
    check(instances, *EQUIRECT, *PERSPECTIVE, min_compared=1000)


@pytest.mark.parametrize("view", PERSPECTIVE)
@pytest.mark.parametrize("distance", [1.2, 3.0])
def test_sphere_in_perspective(view: View, distance: float) -> None:
    """At 1.2 the ball reaches out of the frame on all sides and behind the camera's plane."""
    ahead = direction(view.yaw_deg + 8.0, view.pitch_deg - 5.0)
    ball = placed(sphere(1), distance * ahead)
    check([ball], view, min_compared=60)


def test_around_the_camera() -> None:
    """A closed mesh around the capture centre leaves no hole, and its front is its back."""
    shell = placed(sphere(1), (0.3, -0.2, 0.1))
    for layers in check([shell], *EQUIRECT, *PERSPECTIVE, min_compared=1000):
        assert (layers.front.geometry[..., 3] > 0.0).all()
        np.testing.assert_array_equal(layers.front.geometry, layers.back.geometry)


def test_watertight_where_rays_meet_edges_and_corners() -> None:
    """Pixel centres on vertices, edges and the poles: an octahedron seen from its centre."""
    octahedron = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    faces = [[x, y, z] for x in (0, 1) for y in (2, 3) for z in (4, 5)]
    # Odd sizes put centres on the equator and on the meridians of its edges.
    for size in ((4, 1), (36, 1), (44, 7), (100, 25), (1, 1), (2, 1), (3, 5)):
        view = View(*size, projection="equirect")
        layers = render([placed(mesh(octahedron, np.array(faces)))], view)
        assert (layers.front.geometry[..., 3] > 0.0).all()


@pytest.mark.parametrize("projection", ["perspective", "equirect"])
def test_scale_invariance(projection: str) -> None:
    """A scene 1e-3 or 1e4 times as large gives the same triangles and scaled distances."""
    view = View(63, 31, fov_y_deg=80.0, projection=projection)
    reference = render([placed(soup_mesh(3))], view)
    for scale in (1e-3, 1e4):
        scaled = render([placed(soup_mesh(3), scale=scale)], view)
        differ = scaled.front.material != reference.front.material
        assert differ.mean() < 2e-3
        same = ~differ.any(axis=-1)
        np.testing.assert_allclose(
            scaled.front.geometry[same, 3] / scale, reference.front.geometry[same, 3], rtol=2e-5
        )


def test_facing_follows_mirrored_transforms() -> None:
    """A mirrored closed mesh has the same near and far side as an unmirrored one."""
    view = View(61, 61, fov_y_deg=60.0)
    for projected in (view, View(120, 61, projection="equirect")):
        plain = render([placed(sphere(3), (0, 0, -3))], projected)
        mirrored = render([placed(sphere(3), (0, 0, -3), scale=(-1, 1, 1))], projected)
        for layer, other in ((plain.front, mirrored.front), (plain.back, mirrored.back)):
            both = (layer.geometry[..., 3] > 0) & (other.geometry[..., 3] > 0)
            assert both.sum() > 100
            np.testing.assert_allclose(layer.geometry[both], other.geometry[both], atol=2e-2)
        assert (plain.back.geometry[..., 3] - plain.front.geometry[..., 3]).max() > 1.5


def test_normals_follow_nonuniform_scale() -> None:
    """On an ellipsoid the normal is the gradient of its implicit equation."""
    radii = np.array([1.5, 0.5, 1.0])
    layers = render([placed(sphere(4), (0, 0, -4), radii)], View(101, 101, fov_y_deg=50.0))
    geometry = layers.front.geometry.astype(np.float64)
    seen = geometry[..., 3] > 0.0
    points = View(101, 101, fov_y_deg=50.0).directions()[seen] * geometry[seen][:, 3:]
    gradient = (points - [0, 0, -4]) / radii**2
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    cosine = (gradient * geometry[seen][:, :3]).sum(axis=1)
    # Beyond the silhouette of the facets' chords the comparison means nothing.
    assert np.quantile(cosine, 0.02) > np.cos(np.deg2rad(3.0))


@pytest.mark.parametrize("shade", [False, True])
@pytest.mark.parametrize("projection", ["perspective", "equirect"])
def test_nothing_to_see(projection: str, shade: bool) -> None:
    """Empty scenes, zero-area and NaN triangles, and objects out of view leave no trace."""
    view = View(40, 20, fov_y_deg=40.0, projection=projection)
    empty = mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    point = mesh(np.tile([[0.0, 0.0, -2.0]], (3, 1)), np.array([[0, 1, 2], [0, 0, 1]]))
    needle = mesh(np.array([[-1, 0.01, -2], [0, 0.01, -2], [1, 0.01, -2]]), np.array([[0, 1, 2]]))
    broken = mesh(np.full((3, 3), np.nan), np.array([[0, 1, 2]]))
    at_centre = mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    cases = [[], [empty], [point], [needle], [broken], [at_centre], [empty, broken, point]]
    for shapes in cases:
        layers = render([placed(shape) for shape in shapes], view, shade)
        for layer in (layers.front, layers.back):
            assert layer.geometry.shape == (20, 40, 4)
            assert not layer.geometry.any()
            assert not layer.material.any()
        if shade:
            assert not layers.coverage.any()
            assert (layers.motion == -1e9).all()


def test_broken_triangles_do_not_hide_the_others() -> None:
    shape = quad()
    positions = np.concatenate([shape.positions, np.full((1, 3), np.inf, np.float32)])
    triangles = np.concatenate([shape.triangles, [[0, 1, 4], [0, 0, 0]]])
    view = View(31, 31, fov_y_deg=40.0)
    expected = render([placed(shape, (0, 0, -3))], view)
    found = render([placed(mesh(positions, triangles), (0, 0, -3))], view)
    np.testing.assert_array_equal(found.front.geometry, expected.front.geometry)


def test_memory_is_what_opengl_holds() -> None:
    """Asked of OpenGL, image by image, while views and surfaces come and go."""
    held = [id(entry) for entry in _opengl_objects()]
    with rasterizer([placed(sphere(), (0.0, 0.0, -2.0))]) as opened:
        for view in (*EQUIRECT, PERSPECTIVE[0]):
            opened.render(view, shade=True)
            opened.set_surface(np.zeros((view.height, view.width, 4), np.float32))
        own = [entry for entry in _opengl_objects() if id(entry) not in held]
        with opened._context:
            assert sum(opened.memory.values()) == sum(map(_bytes, own))
    assert opened.memory["OpenGL textures"] == 0
    assert len(opened.memory) == 6


def _opengl_objects() -> list[moderngl.Texture | moderngl.Renderbuffer | moderngl.Buffer]:
    kinds = (moderngl.Texture, moderngl.Renderbuffer, moderngl.Buffer)
    gc.collect()
    return [
        entry
        for entry in gc.get_objects()
        if isinstance(entry, kinds) and not isinstance(entry.mglo, moderngl.InvalidObject)
    ]


def _bytes(entry: moderngl.Texture | moderngl.Renderbuffer | moderngl.Buffer) -> int:
    if isinstance(entry, moderngl.Renderbuffer):
        return 4 * entry.width * entry.height
    return entry.size if isinstance(entry, moderngl.Buffer) else len(entry.read())
