"""Materials and textures of the layers, and the errors of the rasterizer."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from iprt.errors import DeviceError, SceneError
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.geometry.sampler import Sampler, Wrap
from iprt.raster.rasterizer import Rasterizer
from tests.oracles.raster import cast, gather
from tests.raster.shapes import mesh, placed, quad, rasterizer, sphere

PERSPECTIVE = View(61, 51, fov_y_deg=50.0)
EQUIRECT = View(360, 181, projection="equirect")


def ramp(size: int = 64) -> np.ndarray:
    """Texture whose bilinear value at (u, v) is (u, v, 1) away from the wrap-around."""
    centre = (np.arange(size) + 0.5) / size
    image = np.ones((size, size, 3), np.float32)
    image[..., 0] = centre[None, :]
    image[..., 1] = 1.0 - centre[:, None]  # row 0 is at v = 1
    return image


def tilted(shape, name: str = "object"):
    """Turned enough that screen-linear interpolation of uv would be off by many texels."""
    rotation = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])
    return placed(shape, (0.0, 0.0, -2.0), rotation=rotation, name=name)


@pytest.mark.gl
@pytest.mark.parametrize("view", [PERSPECTIVE, EQUIRECT])
@pytest.mark.parametrize("repeats", [1, 2])
def test_texture_coordinates(view: View, repeats: int) -> None:
    shape = quad((Material(albedo=(0.5, 1.0, 0.25), texture=ramp()),))
    instance = tilted(replace(shape, uvs=shape.uvs * repeats - (repeats - 1.0)))
    with rasterizer([instance]) as opened:
        layers = opened.render(view, shade=False)
    soup = gather([instance])
    hits = cast(soup, view.directions())
    seen = (hits.triangle >= 0) & (layers.front.geometry[..., 3] > 0.0)
    uv = np.einsum("nk,nkc->nc", hits.weights[seen], soup.uvs[hits.triangle[seen]])
    uv -= np.floor(uv)
    inner = (np.abs(uv - 0.5) < 0.5 - 0.12 * repeats).all(axis=1)
    assert inner.sum() > 40
    found = layers.front.material[seen][inner]
    np.testing.assert_allclose(found[:, 0], 0.5 * uv[inner, 0], atol=4e-3)
    np.testing.assert_allclose(found[:, 1], uv[inner, 1], atol=4e-3)
    np.testing.assert_allclose(found[:, 2], 0.25, atol=1e-3)


@pytest.mark.gl
@pytest.mark.parametrize("view", [PERSPECTIVE, EQUIRECT])
def test_minified_textures_are_averaged(view: View) -> None:
    """A checkerboard far finer than the pixels is grey."""
    checks = np.repeat((np.indices((256, 256)).sum(axis=0) % 2)[..., None], 3, 2)
    shape = quad((Material(albedo=(1, 1, 1), texture=checks.astype(np.float32)),))
    with rasterizer([placed(shape, (0, 0, -2.5))]) as opened:
        layers = opened.render(view, shade=False)
    albedo = layers.front.material[layers.front.geometry[..., 3] > 0.0][:, :3]
    assert len(albedo) > 100
    assert np.abs(albedo - 0.5).max() < 0.02


@pytest.mark.gl
@pytest.mark.parametrize("wrap", ["clamp", "mirror"])
def test_textures_beyond_their_borders(wrap: Wrap) -> None:
    """Coordinates from -1 to 2, of a texture whose value is u, 1 - v."""
    sampler = Sampler((wrap, wrap))
    material = Material(albedo=(1, 1, 1), texture=ramp(), samplers=(sampler, *[Sampler()] * 4))
    shape = quad((material,))
    instance = placed(replace(shape, uvs=3.0 * shape.uvs - 1.0), (0.0, 0.0, -2.5))
    with rasterizer([instance]) as opened:
        layers = opened.render(PERSPECTIVE, shade=False)
    soup = gather([instance])
    hits = cast(soup, PERSPECTIVE.directions())
    seen = (hits.triangle >= 0) & (layers.front.geometry[..., 3] > 0.0)
    uv = np.einsum("nk,nkc->nc", hits.weights[seen], soup.uvs[hits.triangle[seen]])
    inside = np.clip(uv, 0, 1) if wrap == "clamp" else 1.0 - np.abs(1.0 - uv % 2.0)
    assert ((uv < -0.3) | (uv > 1.3)).any(axis=1).sum() > 100
    found = layers.front.material[seen][:, :2]
    # A ramp is flat within half a texel of its ends, and a mipmap's texels are wider.
    np.testing.assert_allclose(found, inside, atol=0.04)


@pytest.mark.gl
def test_materials_of_several_instances() -> None:
    """Numbers run on across instances; a texture stays on its own material."""
    red = np.full((1, 1, 3), [1.0, 0.0, 0.0], np.float32)
    plain, textured = Material(albedo=(0.2, 0.4, 0.6)), Material(albedo=(0.5, 1, 1), texture=red)
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    instances = [
        placed(mesh(corners, faces, materials=(plain, textured)), (-1.1, 0, -4), name="left"),
        placed(mesh(np.zeros((0, 3)), np.zeros((0, 3))), name="empty"),
        placed(mesh(corners, faces, materials=(textured, plain)), (1.1, 0, -4), name="right"),
    ]
    with rasterizer(instances) as opened:
        material = opened.render(View(80, 40), shade=True).front.material
        assert len(opened.materials) == 5
        np.testing.assert_array_equal(opened.material_object, [0, 0, 1, 2, 2])
    colors = {1: (0.2, 0.4, 0.6), 2: (0.5, 0, 0), 4: (0.5, 0, 0), 5: (0.2, 0.4, 0.6)}
    numbers = material[..., 3].astype(int)
    assert set(np.unique(numbers)) == {0, *colors}
    for number, color in colors.items():
        np.testing.assert_allclose(
            material[numbers == number][:, :3], [color] * (numbers == number).sum(), atol=1e-6
        )


def test_without_egl(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_: object) -> None:
        raise Exception("libEGL.so not loaded\n")

    monkeypatch.setattr(moderngl, "create_context", fail)
    with pytest.raises(
        DeviceError, match=r"libEGL\.so not loaded.*apt-get install -y libegl1"
    ) as caught:
        Rasterizer([])
    assert "\n" not in str(caught.value)


@pytest.mark.gl
def test_bad_transforms() -> None:
    with rasterizer([placed(sphere(0), (0, 0, -3), name="ball")]) as opened:
        for matrix in (np.eye(3), np.full((4, 4), np.nan)):
            with pytest.raises(SceneError, match=r"ball.*4x4"):
                opened.move([Instance("ball", sphere(0), matrix)])


@pytest.mark.gl
def test_flattening_transforms() -> None:
    """A ball flattened to a disc still renders, with the disc's normal and no NaN."""
    with rasterizer([placed(sphere(2), (0, 0, -3), (1, 1, 0))]) as opened:
        opened.move([placed(sphere(2), (0.1, 0, -3), (1, 1, 0))])
        layers = opened.render(PERSPECTIVE, shade=True)
    seen = layers.front.geometry[..., 3] > 0.0
    assert seen.sum() > 100
    assert np.isfinite(layers.front.geometry).all()
    assert np.isfinite(layers.motion).all()
    np.testing.assert_allclose(np.abs(layers.front.geometry[seen][:, 2]), 1.0, atol=1e-5)
