"""Covered objects in a furnace, with light that rays are aimed at, and which lights they find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.geometry.material_needs import MaterialNeeds
from tests.trace.closed_forms import BOX_VIEW as VIEW
from tests.trace.closed_forms import RUNS, box_truth
from tests.trace.estimators import Estimator, confirm, furnace, kernels, lamps
from tests.worlds import disc

RAYS = 32
VARNISHED = Material("principled", (0.8, 0.5, 0.2), alpha=0.2, metallic=0.4, clearcoat=0.9)
DULL = replace(VARNISHED, alpha=0.0, clearcoat_alpha=0.2)
VELVET = Material("principled", (0.2, 0.1, 0.1), alpha=0.5, sheen=(0.9, 0.4, 0.2))
DUSTY = Material("principled", (0.9, 0.6, 0.3), alpha=0.0, metallic=1.0, sheen=(0.3, 0.3, 0.3))


@pytest.mark.thorough
@pytest.mark.parametrize("estimator", ["delta, aimed", "em, aimed", "pt-diff, aimed"])
@pytest.mark.parametrize(
    "material",
    [VARNISHED, DULL, VELVET, DUSTY],
    ids=["varnished", "dull coat", "velvet", "dusty mirror"],
)
def test_a_sheet_reflects_its_albedo(
    device: ComputeDevice, material: Material, estimator: Estimator
) -> None:
    sheet = disc((0.1, -0.7, -1.0), 0.5, material)
    frame = furnace("sphere")
    with kernels(device, frame, [sheet], estimator, aim_at=lamps(frame), view=VIEW) as run:
        runs = [run.reflected(seed, RAYS) for seed in range(RUNS)]
        inside, whole = box_truth(run, material)
    assert inside.sum() > 100
    for lobe in ("diffuse", "specular"):
        if material.metallic < 1.0 or lobe == "specular":
            found = np.array([one[lobe][inside, 0] for one in runs])
            confirm(found, whole[lobe], rounding=1e-2)


def test_filters_take_the_roughness_below(device: ComputeDevice) -> None:
    """The noise of a wide lobe below a narrow clearcoat is the stronger."""
    material = replace(VARNISHED, clearcoat_alpha=0.05)
    sheet = disc((0.1, -0.7, -1.0), 0.5, material)
    frame = furnace("sphere")
    with kernels(device, frame, [sheet], aim_at=lamps(frame), view=VIEW) as run:
        visible, layout = run.renderer.visible, run.renderer.layout
        roughness, shown = (
            layout.interior(run.device.read(planes))[0]
            for planes in (visible.roughness, visible.id)
        )
    assert (shown > 0.0).sum() > 100
    np.testing.assert_allclose(roughness[shown > 0.0], material.alpha, rtol=1e-3)


def test_only_covered_materials_need_the_kernels() -> None:
    plain = Material("principled", clearcoat_alpha=0.5, sheen_alpha=0.1)
    assert not MaterialNeeds.of([plain, Material("plastic", clearcoat=1.0)]).covered
    for material in (VARNISHED, VELVET, replace(plain, tint=(1.0, 1.0, 0.9))):
        assert MaterialNeeds.of([Material(), material]).covered
