"""Results of measurements on a device: rows of figures in a file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "out" / "on_device"


@pytest.fixture
def tell(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Append a row of figures to the results."""

    def append(**figures: object) -> None:
        with (OUT / "results.jsonl").open("a", encoding="utf-8") as file:
            print(json.dumps({"case": request.node.name, **figures}), file=file)

    return append
