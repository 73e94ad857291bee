"""Device memory is known before it is allocated, and the settings that messages name lower it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from numpy.typing import NDArray

from iprt import cli
from iprt.device.budget import PICTURE, REMEDIES, remedy, what_to_lower
from iprt.device.compute import ComputeDevice
from iprt.device.plan import UnbuiltKernel
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.memory import RenderPlan
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.oracles.worlds import World
from tests.worlds import ball, bright_walls, room_frame

ROOM = World()
VIEW = View(96, 64, pitch_deg=-30.0)
MATERIALS = (
    Material(),
    Material("conductor", (0.9, 0.7, 0.3), alpha=0.2),
    Material(texture=np.ones((64, 32, 3), np.float32)),
)
SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "rays draw": {"gbuffer": "cl"},
    "layers": {"method": "iprt2023"},
    "ratio": {"method": "iprt2023", "iprt2023": {"objects": "triangles"}},
    "ibl": {"method": "ibl"},
    "dit": {"method": "dit"},
    "dpt": {"method": "dpt"},
    "oil": {"method": "oil"},
    "vct": {"method": "vct"},
    "dvct": {"method": "dvct"},
}


@pytest.fixture(scope="module")
def frame() -> Frame:
    return room_frame(ROOM, 128, 64, bright_walls)


def objects(subdivisions: int = 4) -> list[Instance]:
    places = ((0.2, -1.0, -1.4), (0.9, -1.0, -1.4), (-0.6, -1.0, -1.4))
    return [
        ball(place, 0.25, material, subdivisions=subdivisions)
        for place, material in zip(places, MATERIALS, strict=True)
    ]


class Idle(ComputeDevice):
    """Allocates and transfers, but computes nothing: compiling would take minutes."""

    def kernel(self, *_: Any, **__: Any) -> Any:
        return UnbuiltKernel()

    def read(self, array: Any) -> NDArray[Any]:
        """Return zeros, as a `PlanDevice` does: no kernel has written what is read."""
        return np.zeros(array.shape, array.dtype)


@pytest.mark.thorough
@pytest.mark.parametrize("video", [False, True])
@pytest.mark.parametrize("projection", ["rectilinear", "equirect"])
@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
def test_what_is_planned_is_what_the_driver_is_asked_for(
    settings: dict[str, Any],
    projection: str,
    video: bool,
    device: ComputeDevice,
    frame: Frame,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Counted at pyopencl, so that a buffer which somebody makes beside the accounts is seen.

    Only what shares the host's arrays, which kernels do not write, is not in the accounts.
    """
    view = VIEW if projection == "rectilinear" else View(96, 48, projection="equirect")
    chosen = Settings.model_validate(settings)
    stays = Footage.of(frame, video=video, static_camera=video)
    plan = RenderPlan.of(frame, objects(), view, chosen, stays)
    asked: list[int] = []

    class Counted(cl.Buffer):  # type: ignore[misc]
        def __init__(self, context: Any, flags: Any, size: int = 0, **rest: Any) -> None:
            super().__init__(context, flags, size, **rest)
            if flags & cl.mem_flags.READ_WRITE or not flags & cl.mem_flags.USE_HOST_PTR:
                asked.append(self.size)

    monkeypatch.setattr(cl, "Buffer", Counted)
    own = Idle(device.device)
    with Renderer(own, frame, objects(), view, chosen, footage=stays) as renderer:
        renderer.render(1)
        renderer.load(frame)
    assert sum(asked) == pytest.approx(plan.bytes, rel=0.02)
    assert max(asked) == max(plan.buffers.values())


def shares(plan: RenderPlan) -> dict[str, int]:
    found = dict.fromkeys({*REMEDIES.values(), PICTURE}, 0)
    for name, size in plan.buffers.items():
        found[remedy(name)] += size
    return found


LOWERED: dict[str, Callable[[Frame], tuple[Frame, View, dict[str, Any], int]]] = {
    "lower --size": lambda frame: (frame, View(48, 32, pitch_deg=-30.0), {}, 4),
    "use a smaller panorama": lambda frame: (
        room_frame(ROOM, 64, 32, bright_walls),
        VIEW,
        {},
        4,
    ),
    "lower irradiance.rows": lambda frame: (frame, VIEW, {"irradiance": {"rows": 64}}, 4),
    "lower iprt.ratio_rows": lambda frame: (frame, VIEW, {"iprt": {"ratio_rows": 32}}, 4),
    "use simpler meshes and textures": lambda frame: (frame, VIEW, {}, 3),
    "lower dit.resolution": lambda frame: (frame, VIEW, {"dit": {"resolution": 128}}, 4),
    "lower learning.models": lambda frame: (frame, VIEW, {"learning": {"models": 1024}}, 4),
    "lower learning.samples": lambda frame: (frame, VIEW, {"learning": {"samples": 1024}}, 4),
    "lower vct.voxels": lambda frame: (frame, VIEW, {"vct": {"voxels": 64}}, 4),
    "lower vct.object_voxels": lambda frame: (frame, VIEW, {"vct": {"object_voxels": 32}}, 4),
    "lower dvct.room_voxels": lambda frame: (frame, VIEW, {"dvct": {"room_voxels": 64}}, 4),
    "lower dvct.voxels": lambda frame: (frame, VIEW, {"dvct": {"voxels": 32}}, 4),
    "lower dvct.map_side": lambda frame: (frame, VIEW, {"dvct": {"map_side": 32}}, 4),
}


@pytest.mark.parametrize("what", LOWERED)
def test_what_is_said_to_be_lowered_is_what_gets_lower(what: str, frame: Frame) -> None:
    """And nothing else does."""
    less_frame, view, less, subdivisions = LOWERED[what](frame)
    asking = {"dit": "dit", "learning": "oil", "vct": "vct", "dvct": "dvct"}
    method = [("method", asking[group]) for group in less if group in asking]

    def needed(frame: Frame, view: View, subdivisions: int, settings: dict[str, Any]) -> RenderPlan:
        chosen = Settings.model_validate({**dict(method), **settings})
        return RenderPlan.of(frame, objects(subdivisions), view, chosen)

    before = shares(needed(frame, VIEW, 4, {}))
    assert set(before) == set(LOWERED)
    after = shares(needed(less_frame, view, subdivisions, less))
    assert after.pop(what) < before.pop(what)
    assert after == before


def test_words_name_what_takes_most_first() -> None:
    mib = 2**20
    buffers = {"picture": 10 * mib, "real guide": 30 * mib, "panorama.color": 20 * mib}
    buffers["bvh nodes"] = mib  # not worth naming
    assert what_to_lower(buffers) == "lower --size (40 MiB) or use a smaller panorama (20 MiB)"
    assert what_to_lower({}) == PICTURE


def test_the_limits_are_exact(frame: Frame) -> None:
    plan = RenderPlan.of(frame, objects(), VIEW)
    largest = max(plan.buffers.values())
    assert plan.problem("X", plan.bytes, largest) is None
    memory = plan.problem("X", plan.bytes - 1, largest)
    assert memory is not None
    assert memory.startswith("96 x 64 pixels need ")
    assert "on X, which has" in memory
    assert "lower --size (" in memory
    buffer = plan.problem("X", plan.bytes, largest - 1)
    assert buffer is not None
    assert "on X, which allows" in buffer
    assert any(f"({name})" in buffer and remedy(name) in buffer for name in plan.buffers)


def with_limits(monkeypatch: pytest.MonkeyPatch, memory: int, largest: int) -> None:
    """Let all devices be that small."""
    monkeypatch.setattr(ComputeDevice, "memory", memory)
    monkeypatch.setattr(ComputeDevice, "largest_buffer", largest)


MIB = 2**20


@pytest.mark.parametrize(
    ("memory", "largest", "message"),
    [
        (2 * MIB, 2 * MIB, "64 x 48 pixels need "),
        (1024 * MIB, MIB // 4, "64 x 48 pixels need a buffer of "),
    ],
)
def test_a_render_that_does_not_fit_allocates_nothing(
    memory: int,
    largest: int,
    message: str,
    scene: Path,
    tmp_path: Path,
    fails: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with_limits(monkeypatch, memory, largest)

    def refuse(*_: Any) -> None:
        pytest.fail("a buffer was allocated")

    monkeypatch.setattr("iprt.device.buffers.cla.empty", refuse)
    line = fails("render", scene, "-o", tmp_path / "a.png", "--size", 64, 48, code=3)
    assert message in line
    assert any(what in line for what in (PICTURE, *REMEDIES.values()))
    assert not (tmp_path / "a.png").exists()


def test_a_scene_check_tells_the_need_and_warns(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["scene", "check", str(scene)]) == 0
    told = capsys.readouterr().out
    assert "memory: " in told
    assert " MiB for view ahead of 32 x 24; " in told
    assert "pixels need" not in told
    with_limits(monkeypatch, MIB, MIB)
    assert cli.main(["scene", "check", str(scene)]) == 0
    told = capsys.readouterr().out
    assert "warning: view ahead: 32 x 24 pixels need " in told
    assert "lower iprt.ratio_rows (" in told


def test_a_scene_check_needs_no_device(
    scene: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    fails: Callable[..., str],
) -> None:
    assert "there are: 0:0 " in fails("scene", "check", scene, "--device", "zzz", code=3)
    monkeypatch.setattr("iprt.device.choose.cl.get_platforms", list)
    assert cli.main(["scene", "check", str(scene)]) == 0
    told = capsys.readouterr().out
    assert " MiB for view ahead of 32 x 24\n" in told
    assert "box: usable" in told
