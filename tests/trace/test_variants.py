"""Materials whose clear coat, sheen or transmission vary over a surface."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.geometry.variants import Variants
from iprt.settings.model import Settings
from tests.meshes import sphere
from tests.raster.shapes import placed, quad
from tests.rendering import render
from tests.worlds import Float, sphere_frame

pytestmark = pytest.mark.thorough

VIEW = View(40, 30, fov_y_deg=12.0)
HALVES = np.repeat(np.arange(2, dtype=np.uint8), 8)[None, :].repeat(4, axis=0)
CHECKS = (np.indices((1024, 1024)).sum(axis=0) % 2).astype(np.uint8)
WHITE, DARK = (1.0, 1.0, 1.0), (0.1, 0.1, 0.1)
COATED = Material("principled", DARK, alpha=0.3, clearcoat=0.5, clearcoat_alpha=0.1)
FUZZY = Material("principled", DARK, alpha=0.3, sheen=(0.25, 0.4, 0.5), sheen_alpha=0.3)
MIRROR = Material("conductor", WHITE, alpha=0.0)
PANE = Material("principled", (0.5, 0.5, 0.5), alpha=0.01, transmission=0.5, thin=True)
AROUND = np.diag([-1.0, 1.0, -1.0])
SETTINGS: dict[str, dict[str, Any]] = {
    "rays": {"gbuffer": "cl"},
    "paths": {"gbuffer": "cl", "method": "pt-diff"},
    "layers": {"method": "iprt2023", "iprt2023": {"objects": "layers"}},
    "cones": {"gbuffer": "cl", "method": "vct"},
}


def mapped(material: Material, index: NDArray[np.uint8], **values: Any) -> Material:
    """Return a material with a map of two values of attributes."""
    rows = tuple(zip(*values.values(), strict=True))
    return replace(material, variants=Variants(tuple(values), rows, index))


STRIPED = mapped(COATED, HALVES, clearcoat=(0.0, 1.0), clearcoat_alpha=(0.0, 0.1))
CHECKED = mapped(FUZZY, CHECKS, sheen=((0.0, 0.0, 0.0), (0.5, 0.8, 1.0)))


def board(material: Material) -> list[Instance]:
    return [placed(quad((material,)), (0.0, 0.0, -3.0), 1.0)]


def shown(
    device: ComputeDevice, objects: list[Instance], settings: dict[str, Any], frames: int = 1
) -> Float:
    given = {"fading": 0.0, "atrous": {"levels": 0}, **settings}
    made = Settings.model_validate(given)
    picture = render(device, sphere_frame(4.0, 64, 32, 1.0), objects, VIEW, made, frames)
    return picture.color.astype(np.float64)


def edge_columns() -> NDArray[np.bool_]:
    """Columns of the picture that see texels beside the border in the middle."""
    x = 3.0 * VIEW.directions()[VIEW.height // 2, :, 0] / -VIEW.directions()[VIEW.height // 2, :, 2]
    pixel = 3.0 * VIEW.pixel_angle
    return np.asarray(np.abs(x) < 2.0 / 16 + pixel)


@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
def test_a_half_looks_like_its_plain_material(
    device: ComputeDevice, settings: dict[str, Any]
) -> None:
    """Away from the texels beside the border, up to the rounding of another program."""
    found = shown(device, board(STRIPED), settings)
    halves = [shown(device, board(one), settings) for one in STRIPED.palette]
    edges = edge_columns()
    assert edges.sum() < 16
    middle = VIEW.width // 2
    for half, columns in zip(halves, (slice(0, middle), slice(middle, None)), strict=True):
        kept = ~edges[columns]
        same, wanted = found[:, columns][:, kept], half[:, columns][:, kept]
        np.testing.assert_allclose(same, wanted, rtol=1e-6)
    assert np.abs(halves[0] - halves[1]).mean() > 0.02


@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
def test_a_fine_checker_has_the_mean_of_both_materials(
    device: ComputeDevice, settings: dict[str, Any]
) -> None:
    found = shown(device, board(CHECKED), settings, 4).mean()
    first, second = (shown(device, board(one), settings, 4).mean() for one in CHECKED.palette)
    assert second - first > 0.015
    assert (found - first) / (second - first) == pytest.approx(0.5, abs=0.05)


def test_a_mirror_shows_the_mean_of_both_materials(device: ComputeDevice) -> None:
    """Rays of reflections draw texels too, within the width of their cone."""
    settings = SETTINGS["rays"]
    mirror = placed(quad((MIRROR,)), (0.0, 0.0, -1.5), 0.5, name="mirror")

    def behind(material: Material) -> Float:
        turned = placed(quad((material,)), (0.0, 0.0, 1.5), 1.5, AROUND)
        return float(shown(device, [mirror, turned], settings, 4).mean())

    first, second = (behind(one) for one in CHECKED.palette)
    share = (behind(CHECKED) - first) / (second - first)
    assert share == pytest.approx(0.5, abs=0.05)


def test_light_passes_the_clear_part_of_a_pane(device: ComputeDevice) -> None:
    """Half of a thin wall transmits light, and shows the black board behind it."""
    half = mapped(PANE, HALVES, transmission=(0.0, 1.0))
    behind = placed(quad((Material(albedo=(0.0, 0.0, 0.0)),)), (0.0, 0.0, -3.2), 1.5, name="black")

    def through(material: Material) -> Float:
        return shown(device, [*board(material), behind], SETTINGS["rays"])

    found, opaque, clear = through(half), *map(through, half.palette)
    assert opaque.mean() - clear.mean() > 0.2
    middle, kept = VIEW.width // 2, ~edge_columns()
    left, right = found[:, :middle][:, kept[:middle]], found[:, middle:][:, kept[middle:]]
    assert left.mean() == pytest.approx(opaque.mean(), abs=0.01)
    assert right.mean() == pytest.approx(clear.mean(), abs=0.01)


def test_rays_leave_a_solid_by_another_variant(device: ComputeDevice) -> None:
    """A ball of glass whose clear coat of no strength varies looks as without it."""
    noise = np.random.default_rng(3).integers(0, 2, (64, 64)).astype(np.uint8)
    glass = replace(PANE, thin=False, transmission=1.0, absorption=(0.5, 1.0, 2.0))
    varied = mapped(glass, noise, sheen_alpha=(0.25, 0.36))

    def solid(material: Material) -> Float:
        ball = placed(sphere(4, (material,)), (0.0, 0.0, -3.0), 0.25)
        return shown(device, [ball], SETTINGS["rays"], 4)

    np.testing.assert_allclose(solid(varied).mean(), solid(glass).mean(), rtol=0.002)
