"""What kernels write is checked, and who wrote wrongly is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyopencl as cl
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.plan import PlanDevice
from iprt.footage.properties import Footage
from iprt.renderer import Renderer
from tests.device.checked import INFINITE, CheckedDevice, DefectError
from tests.films import entry_points, films, play

COUNT = 70
STATEMENTS = {
    "fine": "out[i] = in[i];",
    "half": "if (i % 2) out[i] = in[i];",
    "nan": "out[i] = i < 13 ? in[i] : NAN;",
    "infinite": "out[i] = i == 13 ? INFINITY : in[i];",
    "past": "out[i] = in[i]; if (i == count - 1) out[i + 1] = 2.0f;",
    "far past": "out[i] = in[i]; if (i == count - 1) out[i + 900] = 2.0f;",
    "before": "if (i == 0) out[i - 3] = 2.0f;",
    "reads past": "out[i] = in[i] + in[i + 1];",
    "reads before": "out[i] = in[i] + in[i - 1];",
    "reads unwritten": "out[i] = 2.0f * out[i];",
}
SOURCE = """
__kernel void planted(__global const float *restrict in, __global float *restrict out, int count)
{
    int i = get_global_id(0);
    if (i >= count)
        return;
    %s
}
"""


@pytest.fixture
def planted(device: ComputeDevice, tmp_path: Path) -> Callable[..., None]:
    """Launch a kernel of one of `STATEMENTS` from a buffer to another of the given name."""
    checks = CheckedDevice(device)

    def launch(statement: str, name: str = "victim") -> None:
        file = tmp_path / f"{statement}.cl".replace(" ", "_")
        file.write_text(SOURCE % STATEMENTS[statement])
        kernel = checks.kernel(str(file), "planted")
        source = checks.upload("source", np.ones(COUNT, np.float32))
        victim = checks.empty(name, (7, COUNT // 7))
        with checks.profile.section("some pass"):
            kernel((COUNT,), {"in": source, "out": victim}, count=COUNT)

    return launch


@pytest.mark.parametrize("statement", ["fine", "half"])
def test_what_is_right_passes(planted: Callable[..., None], statement: str) -> None:
    planted(statement)


@pytest.mark.parametrize(
    ("statement", "says"),
    [
        ("nan", r"wrote nan to 'victim' at \[1, 3\], the first of 57"),
        ("infinite", r"wrote inf to 'victim' at \[1, 3\]"),
        ("past", r"wrote to 'victim' 1 past its last element"),
        ("far past", r"wrote to 'victim' 900 past its last element"),
        ("before", r"wrote to 'victim' 3 before its first element"),
        ("reads past", r"wrote nan to 'victim' at \[6, 9\]"),
        ("reads before", r"wrote nan to 'victim' at \[0, 0\]"),
        ("reads unwritten", r"wrote nan to 'victim' at \[0, 0\], the first of 70"),
    ],
)
def test_what_is_wrong_is_named(planted: Callable[..., None], statement: str, says: str) -> None:
    with pytest.raises(DefectError, match=says) as caught:
        planted(statement)
    assert str(caught.value).startswith("pass 'some pass': kernel 'planted' of cl/")
    assert "\n" not in str(caught.value)


def test_a_few_buffers_may_hold_infinities(planted: Callable[..., None]) -> None:
    name = next(iter(INFINITE))
    planted("infinite", name)
    with pytest.raises(DefectError, match="wrote nan"):
        planted("nan", name)
    with pytest.raises(DefectError, match="1 past its last element"):
        planted("past", name)


def test_the_host_is_checked_too(device: ComputeDevice) -> None:
    checks = CheckedDevice(device)
    with pytest.raises(DefectError, match=r"the host wrote -inf to 'table' at \[2\]"):
        checks.upload("table", np.array([0.0, 1.0, -np.inf, 2.0], np.float32))
    checks.upload("numbers", np.full(3, -1, np.int32))


def test_all_is_checked_where_the_driver_does_not_tell_what_is_const(
    planted: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(*_: object) -> None:
        raise cl.RuntimeError

    monkeypatch.setattr(cl.Kernel, "get_arg_info", unknown)
    planted("fine")
    with pytest.raises(DefectError, match="1 past its last element"):
        planted("past")


@pytest.mark.gl
@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", ["triangles", "around", "layers around", "remembered", "environment", "nothing"]
)
def test_no_way_to_render_has_a_finding(device: ComputeDevice, name: str) -> None:
    """And checks leave all bits of the picture as they are."""
    picture = play(CheckedDevice(device), films()[name])
    plain = play(device, films()[name])
    np.testing.assert_array_equal(picture.color, plain.color)
    assert picture.aovs.keys() == plain.aovs.keys()
    for layer, values in plain.aovs.items():
        np.testing.assert_array_equal(picture.aovs[layer], values)


def test_films_build_every_kernel() -> None:
    plan = PlanDevice()
    for film in films().values():
        given = (plan, film.video[0], film.objects, film.view, film.settings)
        Renderer(*given, footage=Footage.of(film.video[0], static_camera=film.static_camera))
    assert {one.name for one in plan.kernels} == entry_points()
