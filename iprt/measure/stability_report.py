"""Table of the accuracy and stability of played videos."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import fmean

from iprt.measure.results import grid_of
from iprt.measure.stability import CAUSES, Flicker
from iprt.measure.video_stability import Stability
from iprt.output.grid import Grid

GHOST_AGE = 4
"""Number of frames after something has left at which the table shows its remaining share."""
NOTES = (
    "SSIM, cuts: means over the frames with a truth. change: RMSE of the change from frame to "
    "frame against the truth's, in 1/255.",
    "untouched, relit, object: flicker, the mean absolute difference of consecutive pictures after "
    "motion compensation, in 1/255; x: over the input's, or the truth's, on the same pixels.",
    "trail: frames until moved objects, real things and shadows change the picture "
    f"by less than 1/255; ghost: the share of it still visible {GHOST_AGE} frames later.",
)


def stability_grid(results: Sequence[Stability], background: str) -> Grid:
    """Build a table with one row per view and settings. `results` must not be empty."""
    notes = NOTES if any(result.trails for result in results) else NOTES[:-1]
    return grid_of(f"video; background: {background}", [*map(_row, results)], *notes, words=2)


def _row(result: Stability) -> dict[str, str]:
    cuts = zip(*(scores.ssim_cuts for scores in result.scores.values()), strict=True)
    change = result.temporal_error
    equal = "" if result.unequal == 0 else f" ({result.unequal} pixels differ)"
    row = {
        "view": result.view,
        "settings": result.settings,
        "SSIM": _number(result.mean(lambda scores: scores.ssim), 4),
        "cuts": " ".join(f"{fmean(cut):.3f}" for cut in cuts) or "-",
        "change": _number(None if change is None else 255.0 * change, 2),
        "untouched": _flicker(result.flicker["untouched"]) + equal,
        "relit": _flicker(result.flicker["relit"]),
        "object": _number(255.0 * result.flicker["object"].output, 2),
        "relit/truth": _flicker(result.true_flicker["relit"]),
        "object/truth": _flicker(result.true_flicker["object"]),
    }
    if result.trails:
        found = [result.trails[cause] for cause in CAUSES]
        ages = [trail.ages[min(GHOST_AGE, len(trail.ages) - 1)] for trail in found]
        lengths = ("-" if trail.frames is None else str(trail.frames) for trail in found)
        ghosts = (f"{round(100.0 * age.ghost)}%" if age.known else "-" for age in ages)
        row |= {"trail": ", ".join(lengths), f"ghost at {GHOST_AGE}": ", ".join(ghosts)}
    return row


def _flicker(flicker: Flicker) -> str:
    if flicker.pixels == 0:
        return "-"
    return f"{255.0 * flicker.output:.2f} ({flicker.ratio:.2f}x)"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None or math.isnan(value) else f"{value:.{digits}f}"
