"""Time of a film by one and by two workers on the same device."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

SIZE = (512, 384)
CACHES = ("PYOPENCL_NO_CACHE", "CUDA_CACHE_DISABLE", "NEO_CACHE_PERSISTENT")


def test_workers_share_a_device(
    tmp_path: Path, tell: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Render a film by `--cluster local:1` and `local:2`, with kernels cached as usual."""
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    from tests.farm.cluster.efficiency import by_devices

    for name in CACHES:
        monkeypatch.delenv(name, raising=False)
    tell(**by_devices(tmp_path, SIZE))
