"""Palettes of the values of many texels."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry import variants
from iprt.geometry.material import Material, first_variants, material_table, table_rows
from iprt.geometry.variants import Variants, distinct, grouped, means


def test_few_values_are_kept() -> None:
    planes = np.random.default_rng(1).integers(0, 3, (5, 400), np.uint8)
    values, number = distinct(planes)
    np.testing.assert_array_equal(values[number].T, planes)
    assert len(np.unique(values, axis=0)) == len(values)


def test_many_values_lose_low_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variants, "MOST_DISTINCT", 1000)
    planes = np.random.default_rng(1).integers(0, 256, (3, 20_000), np.uint8)
    values, number = distinct(planes)
    assert 256 < len(values) <= 1000
    error = np.abs(values[number].T.astype(int) - planes)
    assert error.max() <= 16
    assert abs(values[number].mean() - planes.mean()) < 1.0


@pytest.mark.parametrize(("channels", "most"), [(1, 0.0013), (2, 0.02), (4, 0.09)])
def test_the_error_of_256_groups_of_noise(channels: int, most: float) -> None:
    """RMS of values that fill their range evenly, which is the worst case."""
    random = np.random.default_rng(2)
    values, weights = random.random((5000, channels)), random.uniform(0.5, 2.0, 5000)
    group = grouped(values, weights)
    assert np.array_equal(np.unique(group), np.arange(256))
    centres = means(values, weights, group)
    error = np.sqrt(np.average((centres[group] - values) ** 2, axis=0, weights=weights))
    assert error.max() < most
    np.testing.assert_allclose(weights @ centres[group], weights @ values)


def test_fewer_points_than_groups_stay_apart() -> None:
    values = np.array([[0.0], [0.5], [0.5], [1.0]])
    assert grouped(values, np.ones(4)).tolist() == [0, 1, 2, 3]
    repeated = np.repeat(values, 100, axis=0)
    group = grouped(repeated, np.ones(400))
    np.testing.assert_array_equal(means(repeated, np.ones(400), group)[group], repeated)


INDEX = np.array([[0, 1]], np.uint8)
MAPPED = Material(
    "principled",
    clearcoat=0.5,
    variants=Variants(("clearcoat", "sheen"), ((0.0, (1.0, 0.0, 0.0)), (1.0, (0.0,) * 3)), INDEX),
)


def test_variants_follow_all_materials() -> None:
    """The table names the material of each, and is otherwise that of the palette."""
    others = Material("diffuse"), Material("plastic")
    materials = [others[0], MAPPED, others[1], MAPPED]
    assert first_variants(materials) == [0, 4, 0, 6]
    rows = table_rows(materials)
    assert rows == [*materials, *MAPPED.palette, *MAPPED.palette]
    table = material_table(materials).reshape(len(rows), -1, 4)
    assert table[:, 11, 3].tolist() == [0, 1, 2, 3, 1, 1, 3, 3]
    table[:, 11, 3] = 0.0
    plain = material_table([*others, *MAPPED.palette]).reshape(4, -1, 4)
    plain[:, 11, 3] = 0.0
    np.testing.assert_array_equal(table[4:], plain[[2, 3, 2, 3]])


def test_an_edited_value_replaces_its_map() -> None:
    edited = MAPPED.edited(clearcoat=0.25, alpha=0.5)
    assert [one.clearcoat for one in edited.palette] == [0.25, 0.25]
    assert [one.sheen for one in edited.palette] == [one.sheen for one in MAPPED.palette]
    assert {one.alpha for one in edited.palette} == {0.5}
    assert edited.edited(sheen=(0.0, 0.0, 0.0)).variants is None


def test_only_principled_materials_have_variants() -> None:
    assert MAPPED.edited(kind="diffuse").palette == ()


def test_lobes_are_of_all_variants() -> None:
    """Without its clear coat, this metal is a mirror."""
    metal = Material("principled", alpha=0.0, metallic=1.0, clearcoat=0.5, clearcoat_alpha=0.1)
    rows = ((0.0,), (1.0,))
    mapped = metal.edited(variants=Variants(("clearcoat",), rows, INDEX))
    assert mapped.lobes == metal.lobes | {"glossy"}
