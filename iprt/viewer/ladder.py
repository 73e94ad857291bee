"""What quality may be given up for speed, in which order: the ladder that `Pace` climbs.

`docs/ladder.py` measures it and writes `ladder.json`, which is part of the package.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from pydantic import BaseModel, ConfigDict, Field

from iprt.settings.model import Settings
from iprt.settings.overrides import changed, plain_values
from iprt.settings.presets import Quality

FILE = "ladder.json"
NO_SLOWER = 0.99
"""Least that a rung is taken to save."""
SCALE = "scale"
"""Name of the picture's resolution in a ladder: sides relative to the window's."""

Value = bool | int | float


class MeasuredSetting(BaseModel):
    """One setting changed by itself, from the settings at the top."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str
    value: Value
    ms_share: float = Field(gt=0.0, description="Of the time of a frame at the top.")
    ssim_cost: float = Field(description="SSIM at the top minus this one.")


class MeasuredRung(BaseModel):
    """All that is changed on a rung, from the settings at the top."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    changes: dict[str, Value]
    ms_share: float = Field(gt=0.0, description="Of the time of a frame at the top.")
    ssim_cost: float = Field(description="SSIM at the top minus this one.")


class Ladder(BaseModel):
    """Rungs from the best and slowest down, and what they were measured on."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    device: str
    date: str
    scene: str
    views: tuple[str, ...]
    size: tuple[int, int]
    quality: Quality = Field(description="The preset at the top.")
    ms: float = Field(description="Of a frame at the top, mean of the views.")
    ssim: float = Field(description="Of a picture at the top, mean of the views' cuts.")
    compiling: dict[str, int] = Field(
        description="Programs that are compiled when a setting changes; others compile none."
    )
    settings: tuple[MeasuredSetting, ...]
    rungs: tuple[MeasuredRung, ...]

    def cost_of(self, key: str, value: Value) -> float:
        """SSIM that a setting costs by itself at this value; 0 where that was not measured."""
        costs = (k.ssim_cost for k in self.settings if (k.key, k.value) == (key, value))
        return next(costs, 0.0)

    def share_of(self, key: str, value: Value) -> float:
        """Share of the time with only that setting turned; 1 where that was not measured."""
        shares = (k.ms_share for k in self.settings if (k.key, k.value) == (key, value))
        return next(shares, 1.0)


@cache
def measured_ladder() -> Ladder:
    """The ladder of the package."""
    text = files("iprt.viewer").joinpath(FILE).read_text(encoding="utf-8")
    return Ladder.model_validate_json(text)


@dataclass(frozen=True)
class Preview:
    """What a picture in motion lacks.

    Attributes
    ----------
    short : str
        `Preview at 50% resolution`.
    details : str
        All that differs, and what that costs.
    """

    short: str
    details: str


@dataclass(frozen=True)
class Rung:
    """Settings and resolution that are quicker than what the user asked for.

    Attributes
    ----------
    number : int
        0: what the user asked for; higher: quicker.
    settings : Settings
    scale : float
        Sides of the picture relative to the window's, at most 1.
    share : float
        Time of a frame relative to rung 0, as it was measured on another device.
    ssim_cost : float
        SSIM relative to rung 0, as it was measured on another scene.
    preview : Preview or None
        What differs from what was asked for, and what each costs by itself. None: nothing.
    """

    number: int
    settings: Settings
    scale: float
    share: float
    ssim_cost: float
    preview: Preview | None


def rungs_below(base: Settings, ladder: Ladder) -> tuple[Rung, ...]:
    """The rungs that are left below settings, of which the first are these themselves.

    A rung sets no setting to more than `base` has; those that give up nothing more are left out.
    """
    found = [Rung(0, base, 1.0, 1.0, 0.0, None)]
    own, before = plain_values(base), (1.0, 0.0)
    idle_before: Collection[str] = ()
    for measured in ladder.rungs:
        given_up = {
            key: value
            for key, value in measured.changes.items()
            if key != SCALE and float(value) < float(own[key])
        }
        scale = float(measured.changes.get(SCALE, 1.0))
        settings = changed(base, given_up)
        last = found[-1]
        if (settings, scale) != (last.settings, last.scale):
            # Less what was given up from the start, as far as that is known by itself.
            idle = [k for k in measured.changes if k != SCALE and k not in given_up]
            new = [(k, measured.changes[k]) for k in idle if k not in idle_before]
            factor = measured.ms_share / before[0]
            factor /= math.prod(min(ladder.share_of(k, v), 1.0) for k, v in new)
            share = last.share * min(factor, NO_SLOWER)
            cost = last.ssim_cost + measured.ssim_cost - before[1]
            cost = max(cost - sum(ladder.cost_of(k, v) for k, v in new), last.ssim_cost)
            preview = _preview(own, given_up, scale, ladder)
            found.append(Rung(len(found), settings, scale, share, cost, preview))
        before = measured.ms_share, measured.ssim_cost
        idle_before = measured.changes.keys()
    return tuple(found)


def _preview(
    own: Mapping[str, Value], given_up: Mapping[str, Value], scale: float, ladder: Ladder
) -> Preview:
    parts = []
    if scale < 1.0:
        parts.append(f"{100.0 * scale:.0f}% resolution" + _cost(ladder.cost_of(SCALE, scale)))
    for key, value in given_up.items():
        cost = ladder.cost_of(key, value) - ladder.cost_of(key, own[key])
        parts.append(f"{key} {_word(value)} instead of {_word(own[key])}" + _cost(cost))
    short = f"{100.0 * scale:.0f}% resolution" if scale < 1.0 else "reduced quality"
    return Preview(
        f"Preview at {short}",
        "\n".join([*parts, "The picture gets its full quality as soon as nothing moves."]),
    )


def _cost(ssim: float) -> str:
    """What was measured; nothing where that is within a thousandth."""
    return f" (SSIM {-ssim:.3f})" if round(ssim, 3) > 0.0 else ""


def _word(value: Value) -> str:
    return ("off", "on")[value] if isinstance(value, bool) else f"{value:g}"


def order_of_notches(notches: Mapping[str, Sequence[MeasuredSetting]]) -> list[MeasuredSetting]:
    """In which order to turn settings down, notch by notch: what saves most for its SSIM first.

    Parameters
    ----------
    notches : mapping of str to sequence of MeasuredSetting
        By setting, from the top down.
    """
    left = {key: list(found) for key, found in notches.items() if found}
    at = dict.fromkeys(left, (1.0, 0.0))  # share and cost of the setting as it is now
    order = []
    while left:

        def price(key: str) -> float:
            """SSIM per factor of time that the next notch saves."""
            share, cost = at[key]
            notch = left[key][0]
            saved = math.log(share / notch.ms_share)
            return max(notch.ssim_cost - cost, 0.0) / saved if saved > 0.0 else math.inf

        key = min(left, key=price)
        notch = left[key].pop(0)
        order.append(notch)
        at[key] = notch.ms_share, notch.ssim_cost
        if not left[key]:
            del left[key]
    return order
