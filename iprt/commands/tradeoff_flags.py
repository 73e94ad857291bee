"""`--time-per-frame` and `--ssim`: settings chosen by a goal of time or accuracy."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.measure.tradeoff import Entry, Tradeoff
    from iprt.settings.overrides import Assignment

LOG = logging.getLogger("iprt.render")
LONGEST_S = 3600.0


@dataclass(frozen=True)
class TradeoffGoal:
    """Goal of a picture: a limit of time or a least accuracy.

    Attributes
    ----------
    flag : str
        The flag and its value, as on the command line.
    choose : callable
        Chooses an entry of a table for a number of pixels and frames; see `Tradeoff.within`.
    """

    flag: str
    choose: Callable[[Tradeoff, int, int], tuple[Entry, bool]]

    @classmethod
    def of(
        cls, time_per_frame: float | None, ssim: float | None, quality: str
    ) -> TradeoffGoal | None:
        """Return the goal in the flags of a verb; None without one.

        Raises
        ------
        IprtError
            A value is not allowed, or flags contradict each other.
        """
        goals = []
        # The comparisons are written so that NaN is rejected too.
        if (seconds := time_per_frame) is not None:
            flag = f"--time-per-frame {seconds:g}"
            if not 0.0 < seconds <= LONGEST_S:
                raise IprtError(f"{flag}: expected seconds above 0, at most {LONGEST_S:g}")
            goals.append(cls(flag, lambda table, *size: table.within(seconds, *size)))
        if (least := ssim) is not None:
            flag = f"--ssim {least:g}"
            if not 0.0 < least <= 1.0:
                raise IprtError(f"{flag}: expected above 0 and at most 1")
            goals.append(cls(flag, lambda table, *size: table.reaching(least, *size)))
        flags = [goal.flag for goal in goals]
        if flags and quality != "balanced":
            flags.insert(0, f"--quality {quality}")
        if len(flags) > 1:
            raise IprtError(f"{' and '.join(flags[:2])}: give one of them")
        return goals[0] if goals else None

    def require_method(self, method: str) -> None:
        """Refuse methods that the table does not cover.

        Raises
        ------
        IprtError
        """
        from iprt.settings.methods import DEFAULT

        if method != DEFAULT:
            raise IprtError(f"{self.flag}: is for the method {DEFAULT}, not for {method}")

    def assignments(
        self, device: str | None, pixels: int, frames: int, given: Sequence[Assignment]
    ) -> list[Assignment]:
        """Return the settings of the entry that meets the goal, or comes nearest, and log it.

        Parameters
        ----------
        device : str or None
            See `choose_device`.
        pixels, frames : int
            Pixels of the picture, and view frames accumulated in it.
        given : sequence of Assignment
            Settings of files and flags, which take precedence over the entry's.
        """
        from iprt.device.choose import choose_device
        from iprt.measure.tradeoff_cache import TimedDevice, tradeoff_for
        from iprt.settings.ladder import KEYS, entry_assignments

        timed = TimedDevice.of(choose_device(device))
        table = tradeoff_for(timed)
        entry, granted = self.choose(table, pixels, frames)
        told = _estimate(table, entry, pixels, frames)
        if granted:
            LOG.info("%s: %s", self.flag, told)
        else:
            LOG.warning("%s: no entry is estimated to reach it; the nearest is %s", self.flag, told)
        if not timed.made(table):
            LOG.info(
                "these times are of another device (%s); `iprt calibrate` measures this one",
                table.device,
            )
        if over := dict.fromkeys(item.key for item in given if item.key in KEYS):
            LOG.info("%s: changed from the entry's, so the estimate is rough", ", ".join(over))
        return entry_assignments(entry.name)


def _estimate(table: Tradeoff, entry: Entry, pixels: int, frames: int) -> str:
    """Return an entry with its estimated time and SSIM as text."""
    from iprt.measure.tradeoff_report import settings_text

    seconds, ssim = entry.seconds_of(pixels), table.ssim(entry, frames)
    return (
        f"'{entry.name}' ({settings_text(entry.name)}), about {seconds.text(2)} s per frame and "
        f"SSIM {ssim.text(3)}, an estimate from the views of {table.truth}"
    )
