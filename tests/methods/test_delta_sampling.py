"""Ways to choose directions: each finds the same light, and aiming finds it with less noise."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device import compute
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.files.resources import CL
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.methods.change import DOWN, ROOM, SCENES, SURE, absolute, agree, change_of
from tests.worlds import ball, ceiling_lamp, room_frame

pytestmark = pytest.mark.gl


@contextmanager
def shares(
    folder: Path, monkeypatch: pytest.MonkeyPatch, box: str, light: str
) -> Iterator[ComputeDevice]:
    """A device whose kernels choose directions in other proportions."""
    text = (CL / "methods/trace_delta.cl").read_text()
    text, replaced = re.subn(r"(#define BOX_SHARE(?:_INSIDE)?) .*", rf"\1 {box}", text)
    text, more = re.subn(r"0\.5f \* \(1\.0f - s\.box_share\)", light, text)
    assert (replaced, more) == (2, 1)
    file = folder / "methods/trace_delta.cl"
    file.write_text(text)
    with monkeypatch.context() as patched:
        patched.setattr(compute, "CL", Instead(file))
        yield ComputeDevice(choose_device("pocl"))


class Instead:
    """`cl/` with another file in place of the one of its name; what others compile is the same."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def __truediv__(self, name: str) -> Path:
        return self._file if name == self._file.name else CL / name


@pytest.fixture(scope="module")
def mixed(device: ComputeDevice) -> NDArray[np.float64]:
    """What the kernels find as they are; see `absolute`."""
    return absolute(device, room_frame(ROOM, 128, 64, ceiling_lamp), SCENES["ball"][1], 6, rays=8)


@pytest.mark.parametrize(
    ("box", "light"),
    [("0.0f", "0.0f"), ("0.9f", "0.0f"), ("0.02f", "0.9f")],
    ids=["cosine", "boxes", "lights"],
)
def test_each_way_to_choose_directions_finds_the_same(
    mixed: NDArray[np.float64],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    box: str,
    light: str,
) -> None:
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = SCENES["ball"][1]
    with shares(tmp_path, monkeypatch, box, light) as other:
        alone = absolute(other, frame, objects, 6, rays=8)
    for part in (0, 1):
        a, b = mixed[:, :, part, 0], alone[:, :, part, 0]
        assert a.mean() > 0.01
        slack = 4.0 * a.std(0, ddof=1) / np.sqrt(len(a)) + 0.003 * a.max()
        agree(b, a.mean(0), slack)
        error = np.hypot(*(np.std(s.mean(1), ddof=1) / np.sqrt(len(s)) for s in (a, b)))
        assert abs(a.mean() - b.mean()) < 4.5 * error + 2e-3 * a.mean()


def test_less_than_a_third_of_the_variance_at_equal_rays(device: ComputeDevice) -> None:
    """The quotient varies so after 16 frames of one ray per pixel, below a lamp."""
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = SCENES["ball"][1]

    def variance(**trace: Any) -> float:
        runs = [
            change_of(device, frame, objects, DOWN, frames=16, seed=s, irradiance=SURE, **trace)[3]
            for s in range(6)
        ]
        return float(np.var(runs, axis=0, ddof=1).mean())

    aimed = variance()
    even = variance(light_sampling=False)
    ratio = variance(estimator="ratio", light_sampling=False)
    print(f"variance: delta, aimed {aimed:.4f}; delta {even:.4f}; ratio {ratio:.4f}")
    assert aimed < 0.33 * ratio
    assert aimed < even


def test_aiming_at_lights_leaves_objects_as_bright(device: ComputeDevice) -> None:
    """And less noisy, whatever they are made of."""
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    materials = {
        "diffuse": Material(albedo=(0.8, 0.8, 0.8)),
        "plastic": Material("plastic", (0.5, 0.5, 0.5), alpha=0.2),
        "conductor": Material("conductor", (0.9, 0.9, 0.9), alpha=0.4),
    }
    objects = [
        ball((x, -0.3, -1.6), 0.35, material)
        for x, material in zip((-0.9, 0.0, 0.9), materials.values(), strict=True)
    ]
    view = View(72, 24, pitch_deg=-10.0, fov_y_deg=35.0)

    def pictures(light_sampling: bool) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        trace = {"rays": 4, "relight_reflections": False, "light_sampling": light_sampling}
        raw = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}, "trace": trace}
        runs: list[NDArray[np.float32]] = []
        for seed in range(8):
            chosen = Settings.model_validate({"seed": seed, **raw})
            with Renderer(device, frame, objects, view, chosen) as renderer:
                shown = renderer.render(4, ("coverage",))
            runs.append(shown.color.mean(-1))
        return np.array(runs), shown.aovs["coverage"] == 1.0

    (all_aimed, solid), (all_even, _) = pictures(True), pictures(False)
    third = np.broadcast_to(np.arange(72) // 24, solid.shape)
    for index, name in enumerate(materials):
        where = solid & (third == index)
        assert where.sum() > 100
        aimed, even = all_aimed[:, where], all_even[:, where]
        means = [runs.mean(1) for runs in (aimed, even)]
        error = np.sqrt(sum(m.var(ddof=1) / len(m) for m in means))
        assert abs(means[0].mean() - means[1].mean()) < 4.0 * error, name
        assert error < 0.03 * means[1].mean(), name
        assert aimed.var(0, ddof=1).mean() < 0.7 * even.var(0, ddof=1).mean(), name
