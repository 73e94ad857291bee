"""What panels and the gizmo use of the browser that they belong to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.displayed import DisplayedFrame, Readout
from iprt.viewer.engine import Engine
from iprt.viewer.objects import ObjectState
from iprt.viewer.viewport import Viewport


class BrowserApi(Protocol):
    """See `iprt.viewer.web.browser.Browser`."""

    engine: Engine
    client: Any
    uploads: Path
    viewport: Viewport
    displayed: DisplayedFrame | None
    selected: str | None
    snapping: bool
    aligned: bool
    read: Readout | None

    @property
    def selected_state(self) -> ObjectState | None: ...

    @property
    def centre(self) -> NDArray[np.float64]: ...

    @property
    def lossless(self) -> bool: ...

    def post(self, key: object, do: Callable[[], object]) -> None: ...

    def tell(self, text: str) -> None: ...

    def say(self, text: str) -> None: ...

    def go_to(self, name: str) -> None: ...

    def drop_at(self, point: NDArray[np.float64]) -> bool: ...
