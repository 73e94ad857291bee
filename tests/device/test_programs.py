"""How many programs pictures need: each costs a second or more before the first one is seen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import pytest

from iprt.device.plan import PlanDevice
from iprt.device.program import PlannedKernel, Program
from iprt.film import footage_of
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.overrides import resolved
from iprt.settings.presets import PRESETS, STILL
from tests.films import films

SCENES = sorted(file.parent for file in Path("scenes360").glob("*/scene.toml"))
DEMO = Path("scenes360/lounge")

MOST_PROGRAMS = 52
"""All scenes, projections and presets, and the films of the tests, with the default method, of
objects without the lobes of `LOBES`."""

LOBES = ("COVERED", "EMISSION", "GLASS", "PRINCIPLED", "TEXTURES", "VIRTUAL_LIGHTS")
"""Defines of programs that only some objects need; lamps and lights share `ADDED_LIGHT`."""

MOST_PER_LOBE = 12
"""Programs for one of these."""

MOST_OF_DEMO = 24
"""What `./run demo` renders."""


def programs(kernels: Iterable[PlannedKernel]) -> set[Program]:
    return {Program.of(kernel.file, kernel.defines) for kernel in kernels}


def planned(
    scene: Scene, presets: Mapping[str, object], views: list[View], **others: object
) -> PlanDevice:
    """Plan renderers of a scene's first view; `others` are further settings."""
    frame, instances = scene.frame(), scene.instances_of(next(iter(scene.views)))
    device = PlanDevice()
    for preset in presets:
        settings = resolved(preset).model_copy(update=others)
        several = len(scene.frame_indices) > 1
        footage = footage_of(scene, frame, settings) if several else None
        for view in views:
            Renderer(device, frame, instances, view, settings, footage=footage)
    return device


def first_view(scene: Scene) -> View:
    return next(iter(scene.views.values())).view.resized(64, 48)


def all_planned() -> Iterator[PlanDevice]:
    around = View(256, 128, projection="equirect")
    for folder in SCENES:
        scene = Scene.open(folder)
        yield planned(scene, PRESETS, [first_view(scene), around])
    for film in films().values():
        if film.settings.method == "iprt":
            device = PlanDevice()
            given = (device, film.video[0], film.objects, film.view, film.settings)
            Renderer(*given, footage=Footage.of(film.video[0], static_camera=film.static_camera))
            yield device


def counted(found: set[Program]) -> str:
    files = [program.file for program in found]
    return ", ".join(f"{file} {files.count(file)}" for file in sorted(set(files)))


@pytest.mark.thorough
def test_scenes_projections_and_presets_share_programs() -> None:
    assert len(SCENES) >= 4
    found = set().union(*(programs(device.kernels) for device in all_planned()))
    apart = (*LOBES, "ADDED_LIGHT")
    plain = {program for program in found if not any(lobe in program.name for lobe in apart)}
    assert len(plain) <= MOST_PROGRAMS, counted(plain)
    for lobe in LOBES:
        own = {program for program in found if lobe in program.name}
        assert 0 < len(own) <= MOST_PER_LOBE, counted(own)


def test_the_demo_needs_few_programs() -> None:
    scene = Scene.open(DEMO)
    device = planned(scene, {"balanced": None}, [first_view(scene)], **STILL)
    # Kernels of moving things are compiled after the picture.
    found = programs(kernel for kernel in device.kernels if not kernel.later)
    assert len(found) <= MOST_OF_DEMO, counted(found)
