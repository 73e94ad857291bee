"""Devices that fail: every failure is one clear error, a lost one gets one more try, none hangs."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from iprt import cli
from iprt.device import buffers, program, recovery
from iprt.device.compute import ComputeDevice
from iprt.device.recovery import with_second_try
from iprt.errors import DeviceError, DeviceHangError, DeviceLostError, KernelError
from iprt.files.resources import CL

DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")
EXHAUSTED = (cl.status_code.MEM_OBJECT_ALLOCATION_FAILURE, cl.status_code.OUT_OF_HOST_MEMORY)


def opencl_error(code: int) -> cl.Error:
    """As pyopencl raises it."""
    record = cl._cl._ErrorRecord(msg="it failed", code=code, routine="clEnqueueNDRangeKernel")
    out_of_memory = code in EXHAUSTED or code == cl.status_code.OUT_OF_RESOURCES
    return (cl.MemoryError if out_of_memory else cl.RuntimeError)(record)


@pytest.fixture
def fails_at(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Let the launches with these numbers fail; what has been launched, by kernel, is returned."""

    def install(numbers: tuple[int, ...], code: int) -> list[str]:
        launched: list[str] = []
        enqueue = cl.enqueue_nd_range_kernel

        def failing(queue: cl.CommandQueue, kernel: cl.Kernel, *args: Any) -> cl.Event:
            launched.append(kernel.function_name)
            if len(launched) - 1 in numbers:
                raise opencl_error(code)
            return enqueue(queue, kernel, *args)

        monkeypatch.setattr(cl, "enqueue_nd_range_kernel", failing)
        return launched

    return install


@pytest.mark.parametrize(
    "code",
    [
        cl.status_code.OUT_OF_RESOURCES,
        cl.status_code.INVALID_COMMAND_QUEUE,
        cl.status_code.INVALID_CONTEXT,
        cl.status_code.DEVICE_NOT_AVAILABLE,
        cl.status_code.EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST,
        -9999,  # NVIDIA's
    ],
)
def test_codes_of_a_lost_device(device: ComputeDevice, code: int) -> None:
    lost = pytest.raises(DeviceLostError, match=re.escape(device.name))
    with lost as caught, device.reported("a kernel"):
        raise opencl_error(code)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("code", EXHAUSTED)
def test_codes_of_exhausted_memory_say_what_to_lower(device: ComputeDevice, code: int) -> None:
    exhausted = pytest.raises(DeviceError, match="ran out of memory at a kernel: ")
    with exhausted as caught, device.reported("a kernel"):
        raise opencl_error(code)
    assert not isinstance(caught.value, DeviceLostError)


def test_defects_stay_what_they_are(device: ComputeDevice) -> None:
    """A wrong argument is no failure of the device: a second try would hide it."""
    with pytest.raises(cl.RuntimeError), device.reported("a kernel"):
        raise opencl_error(cl.status_code.INVALID_KERNEL_ARGS)


@pytest.mark.parametrize("method", ["empty", "zeros"])
def test_a_buffer_that_cannot_be_had_is_one_line(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise opencl_error(cl.status_code.MEM_OBJECT_ALLOCATION_FAILURE)

    own = ComputeDevice(device.device)
    own.buffers["irradiance plane"] = 2**20
    monkeypatch.setattr(buffers.cla, "empty", refuse)
    monkeypatch.setattr(buffers.cl, "Buffer", refuse)
    with pytest.raises(DeviceError) as caught:
        getattr(own, method)("picture", (1024, 1024))
    message = str(caught.value)
    assert "cannot hold the buffer 'picture' (4 MiB)" in message
    assert message.endswith("lower --size (4 MiB) or lower irradiance.rows (1 MiB)")


@pytest.mark.parametrize("lost", [0, 1, 2, 3])
def test_one_try_more(lost: int) -> None:
    tries: list[int] = []

    def attempt() -> int:
        tries.append(len(tries))
        if len(tries) <= lost:
            raise DeviceLostError(f"lost {len(tries)}")
        return len(tries)

    if lost < 2:
        assert with_second_try(attempt) == lost + 1
        return
    with pytest.raises(DeviceLostError, match="lost 2, for the second time"):
        with_second_try(attempt)
    assert len(tries) == 2


@pytest.mark.parametrize("error", [DeviceHangError("hangs"), DeviceError("full"), ValueError()])
def test_other_errors_get_no_second_try(error: Exception) -> None:
    tries: list[int] = []

    def attempt() -> None:
        tries.append(0)
        raise error

    with pytest.raises(type(error)):
        with_second_try(attempt)
    assert len(tries) == 1


# A device that takes long ------------------------------------------------------------------------


@pytest.fixture
def watched(device: ComputeDevice) -> ComputeDevice:
    """The device of the tests with a queue of its own and a limit."""
    own = ComputeDevice(device.device, limit_s=0.1)
    own.context = device.context
    own.queue = cl.CommandQueue(
        device.context, properties=cl.command_queue_properties.PROFILING_ENABLE
    )
    return own


def hold(device: ComputeDevice) -> cl.UserEvent:
    """Work that the queue has not finished until this event is set."""
    held = cl.UserEvent(device.context)
    cl.enqueue_barrier(device.queue, wait_for=[held])
    return held


@pytest.mark.parametrize("use", ["wait", "finish", "read"])
def test_a_hang_ends_the_wait(use: str, watched: ComputeDevice) -> None:
    array = watched.zeros("array", (4,))
    watched.queue.finish()
    held = hold(watched)
    uses = {
        "wait": watched.wait,
        "finish": watched.finish,
        "read": lambda: watched.read(array),
    }
    with pytest.raises(DeviceHangError, match=r"has not answered for 0\.1 s.*--frame-limit"):
        uses[use]()
    held.set_status(cl.command_execution_status.COMPLETE)
    watched.queue.finish()


def test_what_is_done_in_time_is_no_hang(
    watched: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each in less than the limit, all of them together in more, by a clock of the test's own."""
    array = watched.zeros("array", (4,))
    watched.queue.finish()
    monkeypatch.setattr(watched, "limit_s", 600.0)
    now, due = 0.0, 0.0
    held: list[cl.UserEvent] = []
    really_sleep = time.sleep

    def sleep(seconds: float) -> None:
        nonlocal now
        now += seconds
        if not held:
            really_sleep(seconds)
        elif now >= due:
            held.pop().set_status(cl.command_execution_status.COMPLETE)

    monkeypatch.setattr(recovery.time, "sleep", sleep)
    for number in range(4):
        held.append(hold(watched))
        due = now + 400.0
        watched.write(array, np.full(4, number))
        assert watched.read(array)[0] == number
        assert not held
    assert now >= 4 * 400.0


# Whole renders -----------------------------------------------------------------------------------


@pytest.fixture
def render(scene: Path, tmp_path: Path) -> Callable[..., tuple[int, Path]]:
    def run(name: str, *words: str) -> tuple[int, Path]:
        picture = tmp_path / name
        flags = ["--size", "24", "16", "--accumulate", "3", "--device", DEVICE]
        return cli.main(["render", str(scene), "-o", str(picture), *flags, *words]), picture

    return run


@pytest.mark.thorough
def test_a_lost_device_changes_nothing_in_the_picture(
    render: Callable[..., tuple[int, Path]],
    fails_at: Callable[..., list[str]],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Lost in the last frame: all is rendered again, without any of the history."""
    launched = fails_at((), 0)
    status, whole = render("whole.exr")
    assert status == 0
    count = len(launched)
    launched = fails_at((count - 3,), cl.status_code.OUT_OF_RESOURCES)
    status, again = render("again.exr")
    assert status == 0
    assert len(launched) == 2 * count - 2, "from the start"
    (warning,) = caplog.messages
    assert re.search(r" gave up at \w+ \(OUT_OF_RESOURCES\): starting again", warning)
    assert again.read_bytes() == whole.read_bytes()


@pytest.mark.thorough
def test_a_device_lost_twice_is_one_error(
    render: Callable[..., tuple[int, Path]],
    fails_at: Callable[..., list[str]],
    caplog: pytest.LogCaptureFixture,
    capsys: pytest.CaptureFixture[str],
) -> None:
    fails_at((20, 50), cl.status_code.INVALID_COMMAND_QUEUE)
    status, picture = render("a.png")
    assert status == 3
    assert len(caplog.messages) == 1
    error = capsys.readouterr().err
    assert error.startswith("iprt: error: ")
    assert error.count("\n") == 1
    assert "for the second time: choose another --device" in error
    assert [path.name for path in picture.parent.iterdir()] == ["room"]


def test_a_kernel_that_does_not_build_is_one_report(
    render: Callable[..., tuple[int, Path]],
    tmp_path: Path,
    device: ComputeDevice,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    sources = tmp_path / "room" / "kernels"
    shutil.copytree(CL, sources)
    with (sources / "compositing/composite.cl").open("a") as file:
        file.write("\n#error the end of composite.cl\n")
    monkeypatch.setattr(program, "CL", sources)
    monkeypatch.setattr(program, "_program", program._program.__wrapped__)
    status, picture = render("a.png")
    report = capsys.readouterr().err
    assert status == 3
    assert report.startswith("iprt: error: cl/compositing/composite.cl did not build\n")
    assert f"\n  device   {device.device.name.strip()}" in report
    assert f"\n  driver   {device.device.driver_version.strip()}\n" in report
    assert "\n  options  -cl-std=CL1.2" in report
    assert "the end of composite.cl" in report
    assert "Traceback" not in report
    assert "saved as" not in report
    assert [path.name for path in picture.parent.iterdir()] == ["room"]


def test_a_kernel_that_builds_only_at_its_launch_is_named(device: ComputeDevice) -> None:
    with pytest.raises(KernelError, match="march did not build on "), device.reported("march"):
        raise opencl_error(cl.status_code.BUILD_PROGRAM_FAILURE)
