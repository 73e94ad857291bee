"""Subject of a measurement: views with truth, combinations of settings, and seeds."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from iprt.files.message_text import counted
from iprt.measure.combinations import Combination
from iprt.measure.protocol import provenance, provenance_line
from iprt.measure.view_truth import Background, Target

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.scene.scene import Scene

LOG = logging.getLogger("iprt.bench")


@dataclass(frozen=True)
class Measurement:
    """Pictures of views with combinations of settings, scored against the truth.

    Attributes
    ----------
    seeds : int
        Number of pictures of each view and combination, with consecutive seeds from the settings'
        seed on.
    """

    scene: Scene
    targets: tuple[Target, ...]
    chosen: tuple[Combination, ...]
    device: ComputeDevice
    seeds: int = 1
    background: Background = "truth"

    @cached_property
    def made(self) -> dict[str, Any]:
        """The `provenance` of the results."""
        return provenance(self.scene)

    @property
    def runs(self) -> int:
        """Number of pictures."""
        return len(self.chosen) * len(self.targets) * self.seeds

    def announce(self, what: str) -> None:
        """Log the number of runs that follow; `what` describes each."""
        LOG.info(
            "%s: %s of settings, %s, %s; %s",
            counted(self.runs, "run"),
            counted(len(self.chosen), "combination"),
            counted(len(self.targets), "view"),
            counted(self.seeds, "seed"),
            what,
        )

    @property
    def sizes(self) -> str:
        """Names and sizes of the views as text."""
        return ", ".join(f"{t.name} {t.view.width}x{t.view.height}" for t in self.targets)

    def lines(self) -> list[str]:
        """Return lines for a page about the conditions of the measurement."""
        return [
            f"{self.sizes}; on {self.device.name}.",
            f"Scored over the background of the {self.background}, {counted(self.seeds, 'seed')}. "
            "SSIM, FLIP: as displayed. RMSE: linear radiance.",
            provenance_line(self.made),
        ]

    def record(self) -> dict[str, Any]:
        """Return the conditions of the measurement as plain data."""
        return {
            **self.made,
            "device": self.device.name,
            "background": self.background,
            "seeds": self.seeds,
        }
