"""Report of a trade-off table."""

from __future__ import annotations

from statistics import fmean

from iprt.files.message_text import counted
from iprt.measure.pareto import pareto_front
from iprt.measure.results import grid_of
from iprt.measure.tradeoff import Entry, Range, Tradeoff
from iprt.output.grid import Grid
from iprt.settings.ladder import LADDER

SIDE = 512
"""Side in pixels of the picture whose time is shown."""
FRONT = "*"


def settings_text(name: str) -> str:
    """List an entry's changes of the default settings, such as `light_scale=4, atrous.levels=3`."""
    return ", ".join(f"{key}={value}" for key, value in LADDER[name].items()) or "the defaults"


def tradeoff_grid(table: Tradeoff) -> Grid:
    """Build a table with a row per entry, fastest first."""
    marks = pareto_front([(entry.ratio[0], 1.0 - _mean_ssim(entry)) for entry in table.entries])
    rows = []
    for entry, mark in zip(table.entries, marks, strict=True):
        ratio, low, high = entry.ratio
        seconds = entry.seconds_of(SIDE**2)
        ssim = {
            f"SSIM, {counted(frames, 'frame')}": _of_views(table.ssim(entry, frames), 3)
            for frames in table.frames
        }
        rows.append(
            {
                "entry": entry.name,
                "ratio": f"{ratio:.2f} ({low:.2f} to {high:.2f})",
                f"ms, {SIDE}x{SIDE}": _of_views(
                    seconds.scaled(1e3), 0 if seconds.mean > 0.1 else 1
                ),
                "4x pixels": f"{entry.seconds_of(4 * SIDE**2).mean / seconds.mean:.1f}",
                **ssim,
                "front": FRONT if mark else "",
            }
        )
    return grid_of(
        table.device,
        rows,
        *(f"{name}: {settings_text(name)}." for name in LADDER),
        f"Times: views of {table.scene} on {table.device}, driver {table.driver}. SSIM: views "
        f"of {table.truth}. ±: half of the range over the views.",
        "ratio: time relative to 'balanced', timed frame by frame beside it, with the 95% "
        "confidence interval. 4x pixels: times the time for four times the pixels.",
        "SSIM: mean of the cuts after the given number of frames, against path-traced truth.",
        f"{FRONT}: on the Pareto front of time and SSIM, the mean over the numbers of frames.",
    )


def _mean_ssim(entry: Entry) -> float:
    return fmean(value for line in entry.ssim.values() for value in line)


def _of_views(range_: Range, digits: int) -> str:
    """Format mean and half of the range, such as `0.954 ± 0.020`."""
    return f"{range_.mean:.{digits}f} ± {0.5 * (range_.high - range_.low):.{digits}f}"
