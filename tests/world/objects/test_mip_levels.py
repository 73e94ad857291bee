"""Mip levels of textures: means of colors, roughness and directions, whatever the size."""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.geometry.material import Material
from iprt.geometry.sampler import Sampler
from iprt.world.objects import texture_tables
from iprt.world.objects.mip_levels import color_levels, finish_levels, normal_levels
from iprt.world.objects.texture_tables import texture_table

Float = NDArray[np.float32]
SIZES = [(1, 1), (8, 8), (5, 3), (7, 1), (13, 6), (1, 31), (33, 65)]
rng = np.random.default_rng(5)


def image(size: tuple[int, int], channels: int) -> NDArray[np.float32]:
    return rng.random((*size, channels)).astype(np.float32)


@pytest.mark.parametrize("size", SIZES)
def test_all_levels_have_the_mean_of_the_image(size: tuple[int, int]) -> None:
    picture = image(size, 3)
    levels = color_levels(picture)
    expected = list(size)
    for level in levels:
        assert level.shape == (*expected, 4)
        mean = picture.mean(axis=(0, 1), dtype=np.float64)
        np.testing.assert_allclose(level[..., :3].mean(axis=(0, 1)), mean, rtol=1e-5)
        np.testing.assert_array_equal(level[..., 3], 1.0)
        expected = [max(side // 2, 1) for side in expected]
    assert levels[-1].shape == (1, 1, 4)
    np.testing.assert_array_equal(levels[0][..., :3], picture)


def test_a_texel_is_the_mean_over_its_area() -> None:
    """Five rows become two: the middle one counts half in either."""
    rows = np.arange(5, dtype=np.float32).reshape(5, 1, 1) ** 2 * np.ones((5, 1, 3), np.float32)
    found = color_levels(rows)[1][:, 0, 0]
    wanted = [(0 + 1 + 0.5 * 4) / 2.5, (0.5 * 4 + 9 + 16) / 2.5]
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


@pytest.mark.parametrize("size", SIZES)
def test_what_is_hidden_in_holes_does_not_darken_the_rest(size: tuple[int, int]) -> None:
    opacity = (rng.random(size) > 0.6).astype(np.float32)
    opacity[0, 0] = 1.0
    green = np.float32([0.2, 0.7, 0.1])
    levels = color_levels(green * opacity[..., None], opacity)
    for level in levels[1:]:
        everywhere = np.broadcast_to(green, level[..., :3].shape)
        np.testing.assert_allclose(level[..., :3], everywhere, rtol=1e-5)
        assert level[..., 3].mean() == pytest.approx(opacity.mean(dtype=np.float64), rel=1e-5)


def test_the_coarsest_roughness_is_the_mean_alpha() -> None:
    """As `material_table` has it: the map scales the square root of alpha."""
    finish = image((5, 7), 2)
    coarsest = finish_levels(finish)[-1][0, 0]
    assert coarsest[0] == pytest.approx(finish[..., 0].mean(), rel=1e-5)
    assert coarsest[1] ** 2 == pytest.approx(np.square(finish[..., 1]).mean(), rel=1e-5)
    np.testing.assert_array_equal(finish_levels(finish)[0][..., :2], finish)


def test_normals_count_alike_whatever_their_length() -> None:
    tilted = np.float32([[[6.0, 0.0, 8.0], [-0.3, 0.0, 0.4]]])
    levels = normal_levels(tilted)
    np.testing.assert_allclose(levels[1][0, 0, :3], [0.0, 0.0, 0.8], atol=1e-6)
    np.testing.assert_array_equal(levels[0][..., :3], tilted)


def test_levels_follow_their_image_in_the_table() -> None:
    first = Material(texture=image((5, 3), 3))
    second = Material(texture=image((2, 2), 3), samplers=(Sampler(nearest=True), *[Sampler()] * 4))
    table, texels = texture_table([first, second])
    places = table.view(np.uint32)[[1, 3], 0]
    assert list(places) == [0, 15 + 2 + 1]
    assert len(texels) == 15 + 2 + 1 + 4 + 1
    assert first.texture is not None
    mean = first.texture.mean(axis=(0, 1))
    np.testing.assert_allclose(texels[17, :3], mean, atol=1e-3)


def test_levels_are_made_once_for_each_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for later tables, such as after an edit; what belongs to no material is forgotten."""
    made: list[int] = []

    def counted(number: int) -> Callable[..., list[Float]]:
        function = texture_tables._LEVELS[number]

        def count(*arguments: Any) -> list[Float]:
            made.append(number)
            return function(*arguments)

        return count

    monkeypatch.setattr(texture_tables, "_LEVELS", tuple(map(counted, range(4))))
    color, surface = image((8, 8), 3), image((8, 4), 2)
    first = Material("principled", texture=color, surface_texture=surface)
    _, texels = texture_table([first, replace(first, alpha=0.3)])
    assert made == [0, 1]
    _, again = texture_table([replace(first, albedo=(0.1, 0.2, 0.3), metallic=0.5)])
    assert made == [0, 1]
    np.testing.assert_array_equal(again, texels)
    opacity = image((8, 8), 1)[..., 0]
    texture_table([replace(first, opacity_texture=opacity)])
    assert made == [0, 1, 0]
    kept = len(texture_tables._KEPT)
    del opacity
    gc.collect()
    assert len(texture_tables._KEPT) == kept - 1
    del color, surface, first
    gc.collect()
    assert len(texture_tables._KEPT) == kept - 3
