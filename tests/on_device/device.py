"""What a driver says of a device."""

from __future__ import annotations

import pyopencl as cl

from iprt.device.choose import choose
from tests.on_device.cases import Asked, Cases, Row, Value

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


def cases(asked: Asked) -> Cases:
    """One."""
    return {"properties": lambda: properties(asked.device)}


def properties(spec: str) -> list[Row]:
    """A row for each property that the driver knows."""
    choice = choose(spec)
    device = choice.info.handle
    rows: list[Row] = [
        {"property": "device", "value": choice.info.label},
        {"property": "chosen", "value": choice.reason},
    ]
    rows += [
        {"property": name, "value": value}
        for name in PROPERTIES
        if (value := _said(device, name)) is not None
    ]
    config = device.single_fp_config
    for name in ("DENORM", "FMA", "CORRECTLY_ROUNDED_DIVIDE_SQRT"):
        has = bool(config & getattr(cl.device_fp_config, name))
        rows.append({"property": f"single precision: {name.lower()}", "value": str(has)})
    return rows


def _said(device: cl.Device, name: str) -> Value:
    try:
        value = getattr(device, name)
    except (cl.Error, AttributeError):
        return None
    return value if isinstance(value, int | float | str) else str(value)
