"""Choice of the OpenCL device: the one that the user names, else the best one available."""

from __future__ import annotations

import os
import re
import resource
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import pyopencl as cl

from iprt.device.budget import amount
from iprt.device.caches import own_folder, require_caches
from iprt.device.icd import OVERRIDES
from iprt.device.install import opencl_command
from iprt.errors import DeviceError

Kind = Literal["gpu", "cpu", "accelerator", "other"]
VARIABLE = "IPRT_DEVICE"
"""Environment variable that names the device if no option does."""
ORDER = "GPU, Intel's CPU runtime, PoCL, others"


@dataclass(frozen=True)
class DeviceInfo:
    """Properties of a device by which it is chosen.

    Attributes
    ----------
    index : str
        `P:D`, the places of platform and device in the OpenCL loader's lists.
    name, platform, vendor : str
        Names of the device, and of its platform and the platform's vendor.
    version : str
        The platform's version text, which holds the OpenCL version.
    driver : str
        Driver version.
    kind : {"gpu", "cpu", "accelerator", "other"}
    memory_mib : int
        Global memory.
    compute_units : int
    discrete : bool
        The device has its own memory.
    problem : str
        The reason why the device cannot be used; empty if it can.
    """

    index: str
    name: str
    platform: str
    vendor: str
    version: str
    driver: str
    kind: Kind
    memory_mib: int
    compute_units: int
    discrete: bool
    problem: str
    handle: Any = field(default=None, compare=False, repr=False)

    @property
    def label(self) -> str:
        """Index, name, platform and driver on one line, with the problem if there is one."""
        problem = f", not usable: {self.problem}" if self.problem else ""
        return f"{self.index} {self.name} ({self.platform}, driver {self.driver}{problem})"

    def plain(self) -> dict[str, Any]:
        """Return the properties as plain data for JSON."""
        return {name: value for name, value in vars(self).items() if name != "handle"}


@dataclass(frozen=True)
class Choice:
    """A device and the reason for its choice, as a clause that follows its name."""

    info: DeviceInfo
    reason: str


def choose_device(spec: str | None = None) -> cl.Device:
    """Return the pyopencl device that `spec` names; see `choose`."""
    return choose(spec).info.handle


def choose(spec: str | None = None) -> Choice:
    """Choose the device that `spec` names, with the reason.

    Parameters
    ----------
    spec : str, optional
        `gpu`, `cpu`, `P:D`, or part of the name of a platform, its vendor or a device, in any
        case. None reads the environment variable `IPRT_DEVICE` in the same way, else
        `PYOPENCL_CTX`, which pyopencl parses, else takes the best device in the order `ORDER`.

    Raises
    ------
    DeviceError
        There is no device, or `spec` matches none or several. The message lists the devices.
    """
    infos = describe_devices()
    if spec is None and (named := os.environ.get(VARIABLE)):
        try:
            choice = select(named, infos)
        except DeviceError as error:
            raise DeviceError(f"{VARIABLE}='{named}': {error}") from None
        return Choice(choice.info, f"{VARIABLE}='{named}', {choice.reason}")
    if spec is None and "PYOPENCL_CTX" in os.environ:
        return _environment_choice(infos)
    return select(spec, infos)


def describe_devices() -> list[DeviceInfo]:
    """Return `DeviceInfo` of all devices, in the loader's order.

    Raises
    ------
    DeviceError
        There is none (the message gives the command that installs one), or no folder can hold
        compiled kernels.
    """
    require_caches()
    try:
        platforms = cl.get_platforms()
    except cl.Error:  # the loader found no driver
        platforms = []
    infos = []
    for p, platform in enumerate(platforms):
        try:
            devices = platform.get_devices()
        except cl.Error:  # a driver without a device, such as a GPU driver on a machine without GPU
            continue
        infos += [_describe(f"{p}:{d}", device) for d, device in enumerate(devices)]
    if not infos:
        named = "".join(
            f"; {name}={os.environ[name]} is set: drivers are looked for only there"
            for name in OVERRIDES
            if os.environ.get(name) and not os.environ[name].startswith(str(own_folder()))
        )
        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            named += (
                f"; or raise `ulimit -v`: drivers may need more than the {amount(limit)} it allows"
            )
        raise DeviceError(f"no OpenCL device: install a driver with `{opencl_command()}`{named}")
    return infos


def select(spec: str | None, infos: Sequence[DeviceInfo]) -> Choice:
    """Choose among `infos`, at least one, by the rules of `choose`, without OpenCL calls.

    Platforms of the same name and vendor are copies of one driver, such as PoCL from both Debian
    and PyPI. Only the copy with the newest driver is considered, except for `P:D`.
    """
    if spec is not None and re.fullmatch(r"\d+:\d+", spec):
        for info in infos:
            if info.index == spec and info.problem:
                raise DeviceError(f"cannot use the OpenCL device {info.label}")
            if info.index == spec:
                return Choice(info, "named by its place")
        raise DeviceError(f"no OpenCL device {spec}; there are: {_listing(infos)}")
    current = _newest_copies([info for info in infos if not info.problem])
    if not current:
        raise DeviceError(
            f"no usable OpenCL device among {_listing(infos)}: "
            f"install a driver with `{opencl_command(pocl_fails=True)}`"
        )
    if spec is None:
        return Choice(min(current, key=_rank), f"the first in the order {ORDER}")
    if spec.lower() in ("gpu", "cpu"):
        kind = [info for info in current if info.kind == spec.lower()]
        if not kind:
            raise DeviceError(f"no {spec.upper()} among the OpenCL devices: {_listing(infos)}")
        return Choice(min(kind, key=_rank), f"the best {spec.upper()}, in the order {ORDER}")
    return Choice(_by_name(spec, current), f"the only match for '{spec}'")


def _by_name(spec: str, infos: Sequence[DeviceInfo]) -> DeviceInfo:
    # Platforms first: PoCL's devices are named after the processor, so "intel" would match both
    # Intel's runtime and PoCL on an Intel processor.
    text = spec.strip().lower()
    matches = [i for i in infos if text in i.platform.lower() or text in i.vendor.lower()]
    matches = matches or [i for i in infos if text in i.name.lower()]
    if not text or not matches:
        raise DeviceError(f"no OpenCL device fits '{spec}'; there are: {_listing(infos)}")
    if len(matches) > 1:
        raise DeviceError(
            f"'{spec}' fits several OpenCL devices: {_listing(matches)}; name one by its place, "
            f"such as {matches[0].index}"
        )
    return matches[0]


def _newest_copies(infos: Sequence[DeviceInfo]) -> list[DeviceInfo]:
    newest: dict[tuple[str, str], DeviceInfo] = {}
    for info in infos:
        best = newest.setdefault((info.platform, info.vendor), info)
        if _numbers(info.driver) > _numbers(best.driver):
            newest[info.platform, info.vendor] = info
    kept = {_platform_index(info) for info in newest.values()}
    return [info for info in infos if _platform_index(info) in kept]


def _rank(info: DeviceInfo) -> tuple[int, bool, bool, int]:
    pocl = "pocl" in info.vendor.lower()
    if info.kind == "gpu":
        kind = 0
    elif info.kind == "cpu" and info.platform.lower().startswith("intel"):
        kind = 1
    elif info.kind == "cpu" and pocl:
        kind = 2
    else:
        kind = 3
    return kind, pocl, not info.discrete, -info.memory_mib


def _environment_choice(infos: Sequence[DeviceInfo]) -> Choice:
    value = os.environ["PYOPENCL_CTX"]
    try:
        device = cl.create_some_context(interactive=False).devices[0]
    except (cl.Error, RuntimeError, ValueError, IndexError) as error:
        raise DeviceError(
            f"PYOPENCL_CTX='{value}' names no OpenCL device ({error}); there are: {_listing(infos)}"
        ) from error
    info = next(info for info in infos if info.handle == device)
    return Choice(info, f"PYOPENCL_CTX='{value}'")


def _describe(index: str, device: cl.Device) -> DeviceInfo:
    kinds: tuple[tuple[int, Kind], ...] = (
        (cl.device_type.GPU, "gpu"),
        (cl.device_type.CPU, "cpu"),
        (cl.device_type.ACCELERATOR, "accelerator"),
    )
    return DeviceInfo(
        index=index,
        name=device.name.strip(),
        platform=device.platform.name.strip(),
        vendor=device.platform.vendor.strip(),
        version=device.platform.version.strip(),
        driver=device.driver_version.strip(),
        kind=next((name for bit, name in kinds if device.type & bit), "other"),
        memory_mib=device.global_mem_size // 2**20,
        compute_units=device.max_compute_units,
        discrete=not device.host_unified_memory,
        problem=_problem(device),
        handle=device,
    )


def _problem(device: cl.Device) -> str:
    if not device.available:
        return "not available"
    if not device.compiler_available:
        return "it has no compiler"
    # PoCL calls a processor that its LLVM does not know "generic". Old versions then fail to build
    # anything on x86 (github.com/pocl/pocl/issues/1049); newer ones may succeed, so try.
    if device.version.strip().endswith("-generic"):
        try:
            cl.Program(cl.Context([device]), "__kernel void nothing(void) {}").build()
        except cl.Error:
            return "its LLVM is too old for this processor"
    return ""


def _listing(infos: Sequence[DeviceInfo]) -> str:
    return "; ".join(info.label for info in infos)


def _platform_index(info: DeviceInfo) -> str:
    return info.index.partition(":")[0]


def _numbers(version: str) -> list[int]:
    return [int(digits) for digits in re.findall(r"\d+", version)]
