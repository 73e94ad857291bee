"""Models of each parameter, map and extension are read as the materials that they were made of."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from docs.material_rows import ROWS
from iprt.geometry.material import Material
from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_models import BASE, INDEX, MAPS, models, with_map, write_model

MODELS = dict(models())
IMAGES = {field.name for field in fields(Material) if field.name.endswith("texture")}


def simplified(material: Material) -> Material:
    """Return the simplest material of the same look: what the reader makes of it."""
    if material.kind == "principled" and material.transmission == 1.0:
        return replace(material, kind="dielectric", transmission=0.0)
    bare = material.metallic == 0.0 and not material.is_covered and not material.transmits
    return replace(material, kind="plastic") if material.kind == "principled" and bare else material


@pytest.mark.parametrize("name", MODELS)
def test_a_model_has_its_material(tmp_path: Path, name: str) -> None:
    expected = simplified(MODELS[name])
    mesh = load_mesh(write_model(tmp_path / "m.glb", MODELS[name]))
    assert (mesh.dropped, mesh.warnings) == ((), ())
    (material,) = mesh.materials
    assert material.kind == expected.kind
    unused = {"samplers", "places", "kind"} | IMAGES
    if expected.kind == "diffuse":
        unused |= {"alpha", "ior"}
    if max(expected.sheen) == 0.0:
        unused |= {"sheen_alpha"}
    if expected.clearcoat == 0.0:
        unused |= {"clearcoat_alpha"}
    for field in {field.name for field in fields(Material)} - unused:
        found, wanted = getattr(material, field), getattr(expected, field)
        assert found == pytest.approx(wanted, abs=1e-6), field
    for field in IMAGES:
        found, wanted = getattr(material, field), getattr(expected, field)
        assert (found is None) == (wanted is None), field
        if wanted is not None:
            np.testing.assert_allclose(found, wanted, atol=1.01 / 127.5, err_msg=field)


@pytest.mark.parametrize(
    "names",
    [*((name,) for name in MAPS), ("clearcoat", "sheen_alpha", "tint"), ("ior", "tint")],
    ids="-".join,
)
def test_a_map_has_its_palette(tmp_path: Path, names: tuple[str, ...]) -> None:
    """Each texel has the material of its values, and the material itself has their means."""
    mesh = load_mesh(write_model(tmp_path / "m.glb", with_map(*names)))
    assert (mesh.dropped, mesh.warnings) == ((), ())
    (material,) = mesh.materials
    assert material.variants is not None
    # A mean of colors is darker than each of them.
    assert set(material.variants.names) == set(names) | ({"ior"} if "tint" in names else set())
    assert material.variants.index.shape == INDEX.shape
    for texel in np.ndindex(INDEX.shape):
        found = material.palette[material.variants.index[texel]]
        for name in names:
            expected = MAPS[name][INDEX[texel]]
            assert getattr(found, name) == pytest.approx(expected, abs=1e-3), name
        others = {name: getattr(BASE, name) for name in names}
        bare = replace(found, **others, samplers=BASE.samplers)
        for field in fields(Material):
            value = getattr(bare, field.name)
            if field.name not in IMAGES | {"thin", "places"}:
                assert value == pytest.approx(getattr(BASE, field.name), abs=1e-6), field.name
    for name in set(names) - {"ior", "tint"}:
        mean = np.array(MAPS[name])[INDEX].mean(axis=(0, 1))
        assert getattr(material, name) == pytest.approx(mean, abs=1e-3)


def test_each_parameter_has_a_row() -> None:
    """A metal's reflectance and glass's transmittance are stored as the albedo."""
    rows = {row.name for row in ROWS} - {"reflectance", "transmittance"}
    others = {"kind", "samplers", "places", "variants"}
    parameters = {field.name for field in fields(Material)} - others
    assert rows | {"opacity_texture"} == parameters
