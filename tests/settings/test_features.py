"""Only what a scene requires is built: kernels, variants and buffers, read from a plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.plan import PlanDevice, PlannedBuffer
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.features import Features
from iprt.settings.model import Settings
from tests.variants import variant
from tests.worlds import ball, sphere_frame

FRAME = sphere_frame(2.0, 32, 16, 1.0)
VIEW = View(24, 16)
PANORAMA = View(32, 16, projection="equirect")

DIFFUSE = Material()
GLOSSY = Material("conductor", alpha=0.2)
MIRROR = Material("conductor", alpha=0.0)
PLASTIC = Material("plastic")

LAYERS = Settings(method="iprt2023")

UNLIT = Settings.model_validate({"iprt": {"relight_reflections": False}})
VIRTUAL = "trace/trace_virtual.cl"
ESTIMATORS = {"delta": "trace/trace_delta.cl", "ratio": "trace/trace_real.cl"}


def plan(
    *materials: Material,
    view: View = VIEW,
    settings: Settings | None = None,
    frame: Frame = FRAME,
) -> PlanDevice:
    """What a renderer of one ball per material would build."""
    balls = [ball((i, 0.0, -1.5), 0.3, m, subdivisions=1) for i, m in enumerate(materials)]
    device = PlanDevice()
    Renderer(device, frame, balls, view, settings)
    return device


def files(device: PlanDevice) -> set[str]:
    return {one.file for one in device.kernels}


def defines(device: PlanDevice, file: str) -> dict[str, object]:
    """The `-D` of a file's variant for the view; the map around it differs in the projection."""
    variants: list[dict[str, object]] = [
        dict(one.defines) for one in device.kernels if one.file == file
    ]
    assert variants
    same = [{name: v for name, v in used.items() if name != "VIEW_EQUIRECT"} for used in variants]
    assert all(used == same[0] for used in same)
    return variants[0]


def buffers(device: PlanDevice, word: str) -> list[str]:
    return [name for name in device.buffers if word in name]


def test_a_diffuse_scene_builds_and_stores_nothing_glossy() -> None:
    device = plan(DIFFUSE, DIFFUSE)
    assert not buffers(device, "specular")


def test_a_mirror_stores_nothing_diffuse() -> None:
    device = plan(MIRROR)
    assert not buffers(device, "diffuse")
    assert buffers(device, "specular")


def test_kernels_that_trace_are_built_alike_for_all_objects() -> None:
    """Compilers take seconds for each variant."""
    few = tracing(bounces=2, back_faces=False, light_sampling=False, jitter=False)
    glossy = replace(
        FRAME, gloss=np.ones(FRAME.depth.shape, np.uint8), real_materials=(Material("plastic"),)
    )
    one, other = (
        plan(*materials, settings=settings, frame=glossy)
        for materials, settings in (((DIFFUSE,), Settings()), ((MIRROR, GLOSSY, PLASTIC), few))
    )
    for file in (
        "world/real/irradiance.cl",
        "world/real/highlight.cl",
        "compositing/visibility.cl",
        "trace/trace_delta.cl",
        "trace/trace_virtual.cl",
        "trace/trace_gloss.cl",
    ):
        assert defines(one, file) == defines(other, file), file


def test_the_view_and_the_map_around_it_share_what_looks_into_neither() -> None:
    """Rays of real surfaces meet the view only where it holds layers of the objects."""
    for settings, file in ((Settings(), "trace_delta"), (LAYERS, "trace_real")):
        device = plan(DIFFUSE, settings=settings)
        used = [one.defines for one in device.kernels if one.file == f"trace/{file}.cl"]
        assert used
        assert not any("VIEW_EQUIRECT" in variant for variant in used)
    around = plan(DIFFUSE, view=PANORAMA, settings=LAYERS)
    assert "VIEW_EQUIRECT" in defines(around, "trace/trace_real.cl")


@pytest.mark.parametrize("view", [VIEW, PANORAMA])
def test_without_objects_the_panorama_is_resampled_and_that_is_all(view: View) -> None:
    device = plan(view=view)
    assert files(device) == {
        "world/real/inverse.cl",
        "world/real/planes.cl",
        "world/real/pictures.cl",
        "world/real/surface.cl",
        "world/real/pyramid.cl",
        "compositing/real_layer.cl",
        "compositing/composite.cl",
    }
    assert {name.split(".")[0].split()[0] for name in device.buffers} == {
        "panorama",
        "view",
        "real",
        "picture",
    }


@pytest.mark.parametrize("view", [VIEW, PANORAMA])
def test_the_distant_environment_traces_nothing(view: View) -> None:
    device = plan(DIFFUSE, GLOSSY, view=view, settings=Settings(method="ibl"))
    unused = {
        "trace/trace_real.cl",
        "trace/trace_delta.cl",
        "world/real/irradiance.cl",
        "world/objects/object_surface.cl",
        "trace/relight.cl",
    }
    assert not unused & files(device)
    assert not buffers(device, "light columns")
    assert "DISTANT_ENVIRONMENT" in defines(device, "trace/trace_virtual.cl")
    assert not buffers(device, "layers")
    assert not buffers(device, "ratio")
    assert not buffers(device, "real signal")


def test_rasterized_a_view_has_layers_of_its_own_and_of_the_panorama() -> None:
    device = plan(DIFFUSE, settings=LAYERS)
    assert buffers(device, "screen layers")
    assert buffers(device, "equirect layers")
    assert not buffers(device, "bvh")
    assert "OBJECTS_BVH" not in defines(device, "trace/trace_virtual.cl")
    assert "DISTANT_ENVIRONMENT" not in defines(device, "trace/trace_virtual.cl")


@pytest.mark.parametrize("view", [VIEW, PANORAMA])
def test_triangles_are_traced_without_layers(view: View) -> None:
    device = plan(DIFFUSE, view=view)
    assert buffers(device, "bvh nodes")
    assert not buffers(device, "layers")
    assert "world/objects/object_surface.cl" not in files(device)
    assert "OBJECTS_BVH" in defines(device, "trace/trace_virtual.cl")
    assert not buffers(device, "texels")
    textured = plan(replace(DIFFUSE, texture=np.ones((4, 8, 3), np.float32)), view=view)
    assert textured.buffers["bvh texels"] == (4 * 8 + 2 * 4 + 1 * 2 + 1) * 4 * 2


def tracing(**trace: Any) -> Settings:
    return Settings.model_validate({"trace": trace})


def test_lights_and_shadows_off_screen_are_built_where_they_are_used() -> None:
    for estimator in ESTIMATORS:
        assert buffers(plan(DIFFUSE, settings=variant(estimator)), "light columns")
        without = variant(estimator, trace={"light_sampling": False})
        assert not buffers(plan(DIFFUSE, settings=without), "light columns")
    assert buffers(plan(DIFFUSE), "ratio map")
    # The whole panorama needs no map besides; the published method has none.
    assert not buffers(plan(DIFFUSE, view=PANORAMA), "ratio map")
    assert not buffers(plan(DIFFUSE, settings=UNLIT), "ratio map")
    assert not buffers(plan(DIFFUSE, settings=LAYERS), "ratio map")


def test_what_moves_is_remembered_where_the_camera_stays() -> None:
    def built(*materials: Material, settings: Settings | None = None, stays: bool) -> PlanDevice:
        balls = [ball((0.0, 0.0, -1.5), 0.3, m, subdivisions=1) for m in materials]
        device = PlanDevice()
        Renderer(
            device, FRAME, balls, VIEW, settings, footage=Footage.of(FRAME, static_camera=stays)
        )
        return device

    def remembers(device: PlanDevice) -> set[bool]:
        return {
            bool(buffers(device, "background")),
            "world/real/remember.cl" in files(device),
            any("BACKGROUND" in one.defines for one in device.kernels),
        }

    assert remembers(built(DIFFUSE, stays=True)) == {True}
    assert "BACKGROUND" in defines(built(DIFFUSE, stays=True), "world/real/irradiance.cl")
    assert remembers(built(DIFFUSE, stays=False)) == {False}
    assert remembers(built(DIFFUSE, settings=tracing(background=False), stays=True)) == {False}
    # Nothing is traced.
    assert remembers(built(DIFFUSE, settings=Settings(method="ibl"), stays=True)) == {False}
    assert remembers(built(stays=True)) == {False}


class CountingPlan(PlanDevice):
    """Remembers every allocation."""

    def __init__(self) -> None:
        super().__init__()
        self.allocated: list[str] = []

    def empty(self, name: str, *args: Any) -> PlannedBuffer:
        self.allocated.append(name)
        return super().empty(name, *args)


@pytest.mark.parametrize("view", [VIEW, PANORAMA])
def test_a_plan_tells_the_memory(view: View) -> None:
    """No two buffers share a name, under which one would hide the other's bytes."""
    device = CountingPlan()
    objects = [
        ball((0.0, 0.0, -1.5), 0.3, m, subdivisions=1) for m in (DIFFUSE, GLOSSY, MIRROR, PLASTIC)
    ]
    Renderer(device, FRAME, objects, view)
    assert sorted(device.allocated) == sorted(device.buffers)
    assert all(size > 0 for size in device.buffers.values())


def test_described_parts_are_those_that_are_built() -> None:
    described = Features.of([DIFFUSE], VIEW, Settings(), Footage()).describe()
    assert described["diffuse reflection"]
    assert not described["glossy reflection"]
    assert not described["mirror reflection"]
    assert not any(Features.of([], VIEW, Settings(), Footage(openings=True)).describe().values())
