"""Properties of a device, as its driver states them."""

from __future__ import annotations

from collections.abc import Callable

import pyopencl as cl

from iprt.device.compute import ComputeDevice

PROPERTIES = (
    "vendor",
    "version",
    "driver_version",
    "max_compute_units",
    "max_clock_frequency",
    "global_mem_size",
    "global_mem_cache_size",
    "global_mem_cacheline_size",
    "local_mem_size",
    "max_mem_alloc_size",
    "max_constant_buffer_size",
    "max_parameter_size",
    "max_work_group_size",
    "mem_base_addr_align",
    "preferred_vector_width_float",
    "profiling_timer_resolution",
    "single_fp_config",
    "host_unified_memory",
    "endian_little",
    "extensions",
    "registers_per_block_nv",
    "warp_size_nv",
    "compute_capability_major_nv",
    "compute_capability_minor_nv",
    "wavefront_width_amd",
)


def test_properties(device: ComputeDevice, tell: Callable[..., None]) -> None:
    handle = device.device
    found = {name: value for name in PROPERTIES if (value := _stated(handle, name)) is not None}
    config = handle.single_fp_config
    floats = ("DENORM", "FMA", "CORRECTLY_ROUNDED_DIVIDE_SQRT")
    has = {name.lower(): bool(config & getattr(cl.device_fp_config, name)) for name in floats}
    tell(device=device.name, **found, **has)


def _stated(device: cl.Device, name: str) -> str | float | None:
    try:
        value = getattr(device, name)
    except (cl.Error, AttributeError):
        return None
    return value if isinstance(value, int | float | str) else str(value)
