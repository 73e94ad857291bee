"""Pictures of one device, seed and settings have the same bits, in one process and in two.

Lists of pixels and cells are in the order in which work groups happen to run. No result may depend
on it.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt.aovs import AOVS
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.scene import Scene
from tests.frame.whole_frame import METHOD, METHODS, ROOM, VIEW, chosen, still_life
from tests.scene.files import box_room, write_channels, write_scene
from tests.trace.estimators import furnace, kernels, lamps
from tests.waiting import run_python
from tests.worlds import Radiance, ball, bright_walls, ceiling_lamp, room_frame

pytestmark = pytest.mark.gl

VARNISH = Material("plastic", (0.4, 0.3, 0.2), alpha=0.1)


def video() -> tuple[Frame, Frame]:
    """A room with a window and a varnished floor, among bright walls; then a lamp lights it."""

    def with_all(radiance: Radiance) -> Frame:
        frame = room_frame(ROOM, 128, 64, radiance)
        gloss = (frame.normal[..., 1] > 0.9).astype(np.uint8)
        opening = np.zeros(frame.depth.shape, bool)
        opening[25:35, 50:70] = True
        return replace(frame, gloss=gloss, opening=opening, real_materials=(VARNISH,))

    return with_all(bright_walls), with_all(ceiling_lamp)


def walk(
    device: ComputeDevice, method: tuple[str, str], view: View = VIEW
) -> Iterator[RenderedFrame]:
    """Pictures of a head that turns, over a video that changes; grids as coarse as the pictures."""
    first, second = video()
    with Renderer(device, first, still_life(), view, chosen(method)) as renderer:
        for step in range(5):
            if step == 3:
                renderer.load(second)
            if 1 <= step < 4:
                renderer.look(replace(view, yaw_deg=view.yaw_deg + 0.7 * step))
            yield renderer.render(1, AOVS)


def digests(picture: RenderedFrame) -> dict[str, str]:
    layers = {"picture": picture.color, **picture.aovs}
    return {name: hashlib.sha256(image.tobytes()).hexdigest() for name, image in layers.items()}


def read_scene(folder: Path) -> dict[str, str]:
    """Digests of a scene that is read from files, with a window and a sensor's dropouts."""
    write_scene(folder)
    depth = box_room(64, 32)[0].astype(np.float32)
    depth[10:16, 20:30] = depth[20:22, 40:42] = 0.0
    write_channels(folder / "depth.exr", Z=depth)
    frame = Scene.open(folder).frame()
    layers = {"depth": frame.depth, "normal": frame.fitted_normal, "opening": frame.opening}
    return {name: hashlib.sha256(image.tobytes()).hexdigest() for name, image in layers.items()}


def report(folder: str) -> None:
    """Print what another process makes of the same."""
    device = ComputeDevice(choose_device(os.environ.get("IPRT_TEST_DEVICE", "pocl")))
    walks = {"-".join(m): [digests(picture) for picture in walk(device, m)] for m in METHODS}
    print(json.dumps({"scene": read_scene(Path(folder)), **walks}))


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, str]]]:
    """Digests by another process: one thread instead of all, sets and dicts in another order."""
    folder = tmp_path_factory.mktemp("elsewhere") / "scene"
    order = {"PYTHONHASHSEED": "7", "POCL_MAX_PTHREAD_COUNT": "1", "LP_NUM_THREADS": "0"}
    code = f"from tests.frame.test_determinism import report; report({str(folder)!r})"
    done = run_python("-c", code, **order)
    assert done.returncode == 0, done.stderr
    found: dict[str, list[dict[str, str]]] = json.loads(done.stdout)
    return found


@pytest.mark.thorough
@METHOD
def test_two_renderers_make_the_same_bits(
    device: ComputeDevice,
    method: tuple[str, str],
    elsewhere: dict[str, list[dict[str, str]]],
) -> None:
    """Side by side on one device, picture by picture; and in another process."""
    pictures = list(zip(walk(device, method), walk(device, method), strict=True))
    for step, (one, other) in enumerate(pictures):
        np.testing.assert_array_equal(one.color, other.color, f"picture {step}")
        for name in AOVS:
            np.testing.assert_array_equal(one.aovs[name], other.aovs[name], f"{name} {step}")
        assert digests(one) == elsewhere["-".join(method)][step], step
    # What is compared moves, is relit and gleams.
    first, last = pictures[0][0], pictures[-1][0]
    assert (first.color != last.color).mean() > 0.9
    assert first.aovs["ratio"].min() < 0.9
    assert first.aovs["gloss"].any() == (method[0] == "delta")  # published for diffuse surfaces
    assert first.aovs["specular"].any()


@pytest.mark.thorough
def test_scenes_are_read_alike(tmp_path: Path, elsewhere: dict[str, list[dict[str, str]]]) -> None:
    assert read_scene(tmp_path / "scene") == elsewhere["scene"]


def test_the_order_of_listed_pixels_does_not_matter(device: ComputeDevice) -> None:
    frame, floating = furnace("plain"), [ball((0.2, -1.0, -1.3), 0.3, Material())]
    with kernels(device, frame, floating, aim_at=lamps(frame)) as run:
        pixels = run.renderer.method.real_pixels
        assert pixels is not None
        found = run.parts(3, 4), run.irradiance(3, 4)
        listed = device.read(pixels.mask.traced)
        count = int(device.read(pixels.mask.count)[0])
        assert count == listed.size
        shuffled = np.random.default_rng(1).permutation(listed)
        device.write(pixels.mask.traced, shuffled)
        again = run.parts(3, 4), run.irradiance(3, 4)
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one, other)
