"""Whole frames of a video whose exposure and white balance drift: objects drift too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.plan import PlanDevice
from iprt.footage.frame import Frame
from iprt.footage.prepare.exposure import Drift
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.films import FEW
from tests.frame.whole_frame import ROOM, require_finite, rms, still_life
from tests.worlds import bright_walls, landscape_frame, room_frame

Picture = NDArray[np.float32]

VIEW = View(48, 36, pitch_deg=-35.0)
AROUND = View(64, 32, projection="equirect")
FRAME = room_frame(ROOM, 64, 32, bright_walls)
DRIFTING = Footage.of(FRAME, drifts=True)
OBJECTS = still_life()
SETTINGS = Settings.model_validate(FEW)
CAMERA = np.array([[0.7, 0.05, 0.0], [0.02, 0.6, 0.03], [0.0, 0.1, 0.5]])
"""From colors of the reference to a frame that was exposed and balanced otherwise."""


def shown(frame: Frame, camera: NDArray[np.float64]) -> Frame:
    """The frame in other colors, whose map is known."""
    color = (frame.color @ camera.T).astype(np.float32)
    return replace(frame, color=color, color_map=np.linalg.inv(camera))


def furnished() -> Frame:
    """The room with a window in a wall and a glossy floor."""
    rows, columns = np.indices(FRAME.depth.shape)
    return replace(
        FRAME,
        opening=(np.abs(rows - 14) < 3) & (np.abs(columns - 40) < 3),
        gloss=(FRAME.normal[..., 1] > 0.5).astype(np.uint8),
        real_materials=(Material("plastic", alpha=0.2),),
    )


def film(
    device: ComputeDevice,
    frames: Sequence[Frame],
    view: View = VIEW,
    settings: Settings = SETTINGS,
    **others: Any,
) -> list[Picture]:
    """The pictures of a video, one view frame for each of its frames."""
    pictures = []
    with Renderer(device, frames[0], OBJECTS, view, settings, **others) as renderer:
        for index, frame in enumerate(frames):
            if index:
                renderer.load(frame)
            rendered = renderer.render(1, ["coverage", "ratio"])
            pictures.append(rendered.color)
        require_finite(renderer, [rendered])
    return pictures


KINDS: dict[str, tuple[Frame, View, Settings]] = {
    "room": (FRAME, AROUND, SETTINGS),
    "window and gloss": (furnished(), VIEW, SETTINGS),
    "environment": (FRAME, VIEW, Settings.model_validate({**FEW, "method": "ibl"})),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_mapped_frame_shows_the_reference_mapped_back(device: ComputeDevice, kind: str) -> None:
    """And frames without a map are rendered bit for bit as in a video that has none."""
    frame, view, settings = KINDS[kind]
    steady = film(device, [replace(frame) for _ in range(4)], view, settings)
    frames = [frame, replace(frame), shown(frame, CAMERA), replace(frame)]
    drifting = film(device, frames, view, settings, footage=Footage.of(frame, drifts=True))
    for index in range(2):
        assert np.array_equal(steady[index], drifting[index])
    for index, camera in ((2, CAMERA), (3, np.eye(3))):
        expected = steady[index] @ camera.T
        # Overshoot of cubic convolution is limited by channel, edges are found by differences of
        # colors, and uneven pixels weigh texels by their colors: all depend on a map that mixes
        # channels.
        assert rms(drifting[index] - expected) < 4e-3 * float(expected.mean())
        # Rounding decides what few rays meet.
        assert np.isclose(drifting[index], expected, rtol=1e-3, atol=1e-4).mean() > 0.9


def exposed(gains: list[float]) -> list[Frame]:
    """The room, filmed with exposures."""
    return [replace(FRAME, color=FRAME.color * np.float32(gain)) for gain in gains]


def test_untouched_pixels_keep_the_bits_of_the_input(device: ComputeDevice) -> None:
    """The sky, on which no object has influence."""
    world = landscape_frame(64, 32)
    frame = shown(world, CAMERA)
    with Renderer(device, world, OBJECTS, AROUND, SETTINGS, footage=DRIFTING) as renderer:
        renderer.render(2)
        renderer.load(frame)
        rendered = renderer.render(1, ["ratio", "coverage"])
    untouched = (rendered.aovs["ratio"] == 1.0).all(-1) & (rendered.aovs["coverage"] == 0.0)
    assert untouched.mean() > 0.4
    assert np.array_equal(rendered.color[untouched], frame.color[untouched])
    assert not np.array_equal(rendered.color, frame.color)


def test_a_jump_of_the_exposure_is_no_cut(device: ComputeDevice) -> None:
    """Histories and the cache of E_R go on: the picture is as clean after it as before."""
    drift = Drift()
    frames = [drift(frame) for frame in exposed([1.0] * 12 + [0.25] * 2)]
    steady = film(device, exposed([1.0] * 14))
    jumped = film(device, frames, footage=DRIFTING)
    assert rms(jumped[-1] * 4.0 - steady[-1]) < 0.005 * float(steady[-1].mean())


def planned(frame: Frame, objects: list[Instance], **others: Any) -> PlanDevice:
    device = PlanDevice()
    Renderer(device, frame, objects, VIEW, SETTINGS, **others)
    return device


def test_only_videos_that_may_drift_build_for_it() -> None:
    steady = Footage.of(FRAME, video=True)
    still, drifting = (planned(FRAME, OBJECTS, footage=one) for one in (steady, DRIFTING))
    more = set(drifting.buffers) - set(still.buffers)
    assert more == {"color map", "real diffuse", "panorama.radiance"}
    names = [[one.name for one in device.kernels] for device in (still, drifting)]
    assert sorted([*names[0], "diffuse_part"]) == sorted(names[1])
    assert planned(shown(FRAME, CAMERA), OBJECTS).buffers == drifting.buffers
    assert planned(FRAME, [], footage=DRIFTING).buffers == planned(FRAME, []).buffers
