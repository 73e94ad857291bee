"""Advice for a full device memory: the settings that shrink the largest buffers."""

from __future__ import annotations

from collections.abc import Mapping

REMEDIES = {
    "panorama.": "use a smaller panorama",
    "light ": "use a smaller panorama",
    "glossy texels": "use a smaller panorama",
    "highlight ": "use a smaller panorama",
    "equirect layer": "use a smaller panorama",
    "irradiance": "lower irradiance.rows",
    "ratio map": "lower iprt.ratio_rows",
    "vct scene voxels": "lower vct.voxels",
    "vct object voxels": "lower vct.object_voxels",
    "dvct scene voxels": "lower dvct.room_voxels",
    "dvct object voxels": "lower dvct.voxels",
    "dvct delta voxels": "lower dvct.voxels",
    "area light maps": "lower dvct.map_side",
    "prefiltered ": "use a smaller panorama",
    "impostor ": "lower dit.resolution",
    "learned ": "lower learning.models",
    "drawn samples": "lower learning.samples",
    "bvh ": "use simpler meshes and textures",
}
"""Prefix of a buffer's name -> remedy. All other buffers have the picture's size."""
PICTURE = "lower --size"
WORTH_NAMING = 0.1
"""Smallest share of the memory for which a remedy is listed."""


def remedy(buffer: str) -> str:
    """Return the advice that makes a buffer smaller."""
    return next((what for start, what in REMEDIES.items() if buffer.startswith(start)), PICTURE)


def what_to_lower(buffers: Mapping[str, int]) -> str:
    """Describe how to shrink the largest buffers; `buffers` gives bytes by name."""
    shares: dict[str, int] = {}
    for name, size in buffers.items():
        shares[remedy(name)] = shares.get(remedy(name), 0) + size
    ranked = sorted(shares.items(), key=lambda share: -share[1])
    named = [entry for entry in ranked if entry[1] >= WORTH_NAMING * sum(buffers.values())]
    return " or ".join(f"{what} ({amount(size)})" for what, size in named) or PICTURE


def amount(size: int) -> str:
    """Format a number of bytes in MiB or GiB."""
    return f"{size / 2**30:.1f} GiB" if size >= 2**30 else f"{size / 2**20:.0f} MiB"
