"""How many programs pictures need: each costs a second or more before the first one is seen."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

from iprt.device.plan import PlanDevice
from iprt.device.program import Define, variant
from iprt.files.kernel_source import KernelSource
from iprt.files.resources import CL
from iprt.film import footage_of
from iprt.geometry.camera import View
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.overrides import resolved
from iprt.settings.presets import PRESETS

SCENES = sorted(file.parent for file in Path("scenes360").glob("*/scene.toml"))
DEMO = Path("scenes360/lounge")
WORD = re.compile(r"\b[A-Za-z_]\w*\b")

MOST_PROGRAMS = 45
"""All scenes, projections and presets with the default method."""

MOST_OF_DEMO = 22
"""What `./run demo` renders."""


@cache
def preprocessed(file: str, options: tuple[str, ...]) -> str:
    """What the compiler sees of a program: defines that it does not ask for make no other."""
    given = {
        name: text
        for name, _, text in (one[2:].partition("=") for one in options if "-D" in one[:2])
    }
    source = KernelSource(CL / "lib")
    source.define(given)
    source.read((CL / file).read_text())
    macros = (f"{name} {macro}" for name, macro in source.macros.items() if name not in given)
    text = "\n".join(line for line in (*source.lines, *macros) if line.strip())
    return WORD.sub(lambda word: given.get(word[0], word[0]), text)


def programs(kernels: list[tuple[str, str, dict[str, Define]]]) -> set[tuple[str, str]]:
    """File and preprocessed text of each."""
    found = set()
    for file, _, defines in kernels:
        _, options = variant(file, defines)
        found.add((file, preprocessed(file, tuple(options))))
    return found


def planned(scene: Scene, presets: Mapping[str, object], views: list[View]) -> PlanDevice:
    """What renderers of a scene's first view would build."""
    frame, instances = scene.frame(), scene.instances_of(next(iter(scene.views)))
    device = PlanDevice()
    for preset in presets:
        settings = resolved(preset)
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


def counted(found: set[tuple[str, str]]) -> str:
    files = [file for file, _ in found]
    return ", ".join(f"{file} {files.count(file)}" for file in sorted(set(files)))


def test_scenes_projections_and_presets_share_programs() -> None:
    assert len(SCENES) >= 4
    found = set().union(*(programs(device.kernels) for device in all_planned()))
    assert len(found) <= MOST_PROGRAMS, counted(found)


def test_the_demo_needs_few_programs() -> None:
    scene = Scene.open(DEMO)
    found = programs(planned(scene, {"balanced": None}, [first_view(scene)]).kernels)
    assert len(found) <= MOST_OF_DEMO, counted(found)


@pytest.mark.parametrize(
    ("options", "same"),
    [
        (("-DUNKNOWN=1",), True),
        (("-DWIDE=1",), False),
        (("-DVIEW_NARROW=1",), False),
    ],
)
def test_only_what_the_compiler_sees_makes_a_program(options: tuple[str, ...], same: bool) -> None:
    file = "filter/mask.cl"
    assert (preprocessed(file, options) == preprocessed(file, ())) == same
