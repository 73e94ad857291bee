"""Device choice: the rules on lists of devices that no machine has, and the real loader."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import pyopencl as cl
import pytest

from iprt.device import choose as module
from iprt.device.choose import DeviceInfo, choose, choose_device, describe_devices, select
from iprt.errors import DeviceError

POCL = DeviceInfo(
    index="0:0",
    name="pthread-haswell-Intel(R) Xeon(R)",
    platform="Portable Computing Language",
    vendor="The pocl project",
    version="OpenCL 3.0 PoCL 3.1+debian",
    driver="3.1+debian",
    kind="cpu",
    memory_mib=8000,
    compute_units=2,
    discrete=False,
    problem="",
)
POCL_WHEEL = dataclasses.replace(POCL, index="1:0", driver="3.0-rc2")
INTEL = dataclasses.replace(
    POCL,
    index="2:0",
    name="Intel(R) Xeon(R)",
    platform="Intel(R) OpenCL",
    vendor="Intel(R) Corporation",
    driver="2026.22.10.0.01_160000",
)
OTHER = dataclasses.replace(
    POCL, index="3:0", name="Oclgrind Simulator", platform="Oclgrind", vendor="UoB", driver="21.10"
)
NVIDIA = dataclasses.replace(
    POCL,
    index="4:0",
    name="NVIDIA RTX 4000",
    platform="NVIDIA CUDA",
    vendor="NVIDIA Corporation",
    driver="550.54",
    kind="gpu",
    memory_mib=20000,
    discrete=True,
)
NVIDIA_SMALL = dataclasses.replace(NVIDIA, index="4:1", memory_mib=8000)
INTEGRATED = dataclasses.replace(
    NVIDIA,
    index="5:0",
    name="Intel(R) Iris(R)",
    platform="Intel(R) OpenCL Graphics",
    vendor="Intel(R) Corporation",
    memory_mib=64000,
    discrete=False,
)


def chosen(spec: str | None, *infos: DeviceInfo) -> str:
    return select(spec, infos).info.index


def test_order_without_a_spec() -> None:
    worst_first = [OTHER, POCL_WHEEL, POCL, INTEL, INTEGRATED, NVIDIA_SMALL, NVIDIA]
    expected = ["3:0", "1:0", "0:0", "2:0", "5:0", "4:1", "4:0"]
    found = [chosen(None, *worst_first[: n + 1]) for n in range(len(worst_first))]
    assert found == expected


def test_kinds() -> None:
    everything = (POCL, POCL_WHEEL, INTEL, OTHER, NVIDIA, NVIDIA_SMALL, INTEGRATED)
    assert chosen("GPU", *everything) == "4:0"
    assert chosen("cpu", *everything) == "2:0"
    with pytest.raises(DeviceError, match=r"no GPU among the OpenCL devices: 0:0 .*; 3:0 "):
        chosen("gpu", POCL, OTHER)


def test_place_reaches_every_device() -> None:
    assert chosen("1:0", POCL, POCL_WHEEL) == "1:0"
    with pytest.raises(DeviceError, match=r"no OpenCL device 1:1; there are: 0:0 .*1:0 "):
        chosen("1:1", POCL, POCL_WHEEL)


@pytest.mark.parametrize("infos", [(POCL, POCL_WHEEL), (POCL_WHEEL, POCL)])
def test_copies_of_one_driver_resolve_to_the_newest(infos: tuple[DeviceInfo, ...]) -> None:
    assert chosen("pocl", *infos) == "0:0"
    assert chosen("portable", *infos) == "0:0"
    assert chosen("xeon", *infos) == "0:0"
    assert chosen(None, *infos) == "0:0"


def test_versions_compare_as_numbers() -> None:
    newer = dataclasses.replace(POCL, index="1:0", driver="10.0")
    assert chosen("pocl", POCL, newer) == "1:0"


def test_platform_names_go_before_device_names() -> None:
    assert chosen("intel", POCL, INTEL) == "2:0"
    assert chosen("INTEL", POCL) == "0:0"


def test_ambiguous_and_unknown_names_list_the_devices() -> None:
    with pytest.raises(DeviceError, match=r"fits several OpenCL devices: 2:0 .*; 5:0 .*2:0$"):
        chosen("intel", POCL, INTEL, INTEGRATED)
    with pytest.raises(DeviceError, match=r"fits several OpenCL devices: 4:0 .*; 4:1 "):
        chosen("nvidia", NVIDIA, NVIDIA_SMALL)
    for spec in ("amd", "", "  ", "1:", "gpu0"):
        with pytest.raises(DeviceError, match=r"no OpenCL device fits .*0:0 .*; 2:0 "):
            chosen(spec, POCL, INTEL)


def test_unusable_devices_are_passed_over() -> None:
    broken = dataclasses.replace(NVIDIA, problem="no compiler")
    assert chosen(None, broken, POCL) == "0:0"
    with pytest.raises(DeviceError, match=r"cannot use .*4:0 .*not usable: no compiler"):
        chosen("4:0", broken, POCL)
    stale = dataclasses.replace(POCL, index="6:0", driver="9.9", problem="no compiler")
    assert chosen("pocl", POCL, stale) == "0:0"
    with pytest.raises(DeviceError, match=r"no usable OpenCL device among 4:0 .*install"):
        chosen(None, broken)


def test_messages_are_one_line() -> None:
    for spec in ("amd", "gpu", "7:7", "intel"):
        with pytest.raises(DeviceError) as caught:
            chosen(spec, POCL, INTEL, dataclasses.replace(INTEL, index="6:0", platform="Intel 2"))
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("raises", [True, False])
def test_no_device_names_the_command(monkeypatch: pytest.MonkeyPatch, raises: bool) -> None:
    def none() -> list[cl.Platform]:
        if raises:
            raise cl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")
        return []

    monkeypatch.setattr(module.cl, "get_platforms", none)
    with pytest.raises(DeviceError, match=r"no OpenCL device: install .*(apt-get|pip) install"):
        choose_device("cpu")
    assert DeviceError.exit_code == 3


def test_environment_goes_before_the_order_but_not_before_a_spec(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    infos = module.describe_devices()
    last = infos[-1]
    monkeypatch.setenv("PYOPENCL_CTX", last.index)
    assert choose().info == last
    assert "PYOPENCL_CTX" in choose().reason
    assert choose(infos[0].index).info == infos[0]
    monkeypatch.setenv("PYOPENCL_CTX", "no such device")
    with pytest.raises(DeviceError, match="PYOPENCL_CTX='no such device'"):
        choose()


def test_iprt_device_is_used_where_nothing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    infos = module.describe_devices()
    last = infos[-1]
    monkeypatch.setenv("PYOPENCL_CTX", infos[0].index)
    monkeypatch.setenv("IPRT_DEVICE", last.index)
    assert choose().info == last
    assert choose().reason == f"IPRT_DEVICE='{last.index}', named by its place"
    assert choose(infos[0].index).info == infos[0]
    monkeypatch.setenv("IPRT_DEVICE", "")
    assert "PYOPENCL_CTX" in choose().reason
    monkeypatch.setenv("IPRT_DEVICE", "no such device")
    with pytest.raises(DeviceError, match=r"^IPRT_DEVICE='no such device': no OpenCL device fits"):
        choose()


def test_the_real_list_is_in_the_loaders_order() -> None:
    infos = describe_devices()
    devices = [device for p in cl.get_platforms() for device in p.get_devices()]
    assert [info.handle for info in infos] == devices
    for info, device in zip(infos, devices, strict=True):
        assert info.problem or choose_device(info.index) == device


@pytest.mark.parametrize("builds", [True, False])
def test_a_processor_unknown_to_pocl_is_tried(
    monkeypatch: pytest.MonkeyPatch, builds: bool
) -> None:
    class Program:
        def __init__(self, context: object, source: str) -> None:
            pass

        def build(self) -> None:
            if not builds:
                raise cl.RuntimeError("error: unknown target CPU 'generic'")

    monkeypatch.setattr(module.cl, "Context", lambda devices: None)
    monkeypatch.setattr(module.cl, "Program", Program)
    device = SimpleNamespace(
        available=True,
        compiler_available=True,
        version="PoCL HSTR: pthread-x86_64-pc-linux-generic",
    )
    assert bool(module._problem(device)) != builds
    device.version = "PoCL HSTR: pthread-x86_64-pc-linux-haswell"
    assert not module._problem(device)
    device.compiler_available = False
    assert module._problem(device)
