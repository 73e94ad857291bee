"""What time buys: the entries of the ladder with their times and SSIM, and the choice among them.

A table holds what was measured on one device: the seconds of a frame, of each of some views as
fixed + per_pixel · pixels, and the SSIM that pictures have after some numbers of frames. Both
differ from view to view, and an estimate is their mean with the least and the greatest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
import tomlkit
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from iprt.errors import FormatError
from iprt.files.toml_text import parse_toml, printable, read_text
from iprt.settings.ladder import LADDER

SHIPPED = Path(__file__).with_name("tradeoff.toml")
"""Made by `iprt calibrate scenes360/room --ssim -o iprt/measure/tradeoff.toml`."""
MOST_S = 1e6
"""Seconds that no frame takes."""

Seconds = Annotated[float, Field(ge=0.0, le=MOST_S)]
Positive = Annotated[float, Field(gt=0.0, le=MOST_S)]
Similarity = Annotated[float, Field(ge=-1.0, le=1.0)]
Count = Annotated[int, Field(ge=1, le=2**20)]


@dataclass(frozen=True)
class Range:
    """A mean over views, with the least and the greatest of them."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: list[float]) -> Range:
        """From the values of views, at least one."""
        return cls(math.fsum(values) / len(values), min(values), max(values))

    def scaled(self, factor: float) -> Range:
        """In another unit."""
        return Range(factor * self.mean, factor * self.low, factor * self.high)

    def text(self, digits: int) -> str:
        """`0.078 (0.071 to 0.085)`, so many significant digits each."""
        mean, low, high = (f"{value:.{digits}g}" for value in (self.mean, self.low, self.high))
        return mean if low == high else f"{mean} ({low} to {high})"


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Entry(_Table):
    """An entry of the ladder, measured.

    Attributes
    ----------
    name : str
        In `LADDER`.
    ratio : list of float
        Time of a frame of the largest pictures relative to that of the entry `balanced`, and the
        ends of its interval: over views the geometric mean, the lowest end and the highest.
    seconds : dict of str to list of float
        By view: seconds of a frame without its pixels, and those per pixel.
    ssim : dict of str to list of float
        By view: mean SSIM of the cuts after each of the table's numbers of frames.
    """

    name: str
    ratio: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    seconds: Annotated[
        dict[str, Annotated[list[Seconds], Field(min_length=2, max_length=2)]], Field(min_length=1)
    ]
    ssim: Annotated[dict[str, list[Similarity]], Field(min_length=1)]

    def seconds_of(self, pixels: int) -> Range:
        """Estimated seconds of a frame of so many pixels."""
        return Range.of([fixed + slope * pixels for fixed, slope in self.seconds.values()])

    def ssim_after(self, frames: int, measured: list[int]) -> Range:
        """Estimated SSIM of a picture of so many frames.

        Between `measured` numbers of frames it is taken as linear in the logarithm of their
        number; beyond the last it stays.
        """
        at = [math.log(count) for count in measured]
        values = [float(np.interp(math.log(frames), at, line)) for line in self.ssim.values()]
        return Range.of(values)


class Tradeoff(_Table):
    """All entries, measured on a device.

    Attributes
    ----------
    version : str
        That of iprt.
    device, driver : str
        See `TimedDevice`.
    scene : str
        Whose views were timed.
    truth : str
        The scene whose views have the SSIM.
    frames : list of int
        Numbers of frames after which SSIM was measured, rising.
    """

    format: Literal[1] = 1
    version: str
    device: str
    driver: str
    scene: str
    truth: str
    frames: Annotated[list[Count], Field(min_length=1)]
    entries: list[Entry]

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if [entry.name for entry in self.entries] != list(LADDER):
            raise ValueError("its entries are not those of this version")
        if self.frames != sorted(set(self.frames)):
            raise ValueError("frames: expected rising numbers")
        for entry in self.entries:
            if any(len(line) != len(self.frames) for line in entry.ssim.values()):
                raise ValueError(f"entry '{entry.name}': expected an SSIM for each of frames")
        return self

    @classmethod
    def parse(cls, text: str) -> Tradeoff:
        """A table from its TOML.

        Raises
        ------
        ValueError
            It is none, in one line.
        """
        try:
            return cls.model_validate(parse_toml(text))
        except ValidationError as error:
            fault = error.errors()[0]
            where = ".".join(map(str, fault["loc"]))
            reason = printable(fault["msg"].removeprefix("Value error, "))
            raise ValueError(f"{printable(where)}: {reason}" if where else reason) from None

    @classmethod
    def read(cls, path: Path) -> Tradeoff:
        """The table in a file.

        Raises
        ------
        FormatError
            It cannot be read, or is none.
        """
        try:
            return cls.parse(read_text(path))
        except OSError as error:
            raise FormatError(f"{path}: cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise FormatError(f"{path}: {error}") from None

    def text(self, title: str) -> str:
        """The table as TOML under a comment."""
        return f"# {title}\n{tomlkit.dumps(self.model_dump())}"

    def ssim(self, entry: Entry, frames: int) -> Range:
        """Estimated SSIM of an entry's picture of so many frames."""
        return entry.ssim_after(frames, self.frames)

    def within(self, seconds: float, pixels: int, frames: int) -> tuple[Entry, bool]:
        """The most accurate entry whose frames take so long at most; else the quickest.

        Returns
        -------
        Entry
        bool
            Its estimated time fits.
        """
        fitting = [e for e in self.entries if e.seconds_of(pixels).mean <= seconds]
        if fitting:
            return max(fitting, key=lambda entry: self.ssim(entry, frames).mean), True
        return min(self.entries, key=lambda entry: entry.seconds_of(pixels).mean), False

    def reaching(self, ssim: float, pixels: int, frames: int) -> tuple[Entry, bool]:
        """The quickest entry whose pictures have this SSIM on average; else the most accurate.

        Returns
        -------
        Entry
        bool
            Its estimated SSIM is enough.
        """
        enough = [entry for entry in self.entries if self.ssim(entry, frames).mean >= ssim]
        if enough:
            return min(enough, key=lambda entry: entry.seconds_of(pixels).mean), True
        return max(self.entries, key=lambda entry: self.ssim(entry, frames).mean), False


@cache
def shipped() -> Tradeoff:
    """The table that comes with the package."""
    return Tradeoff.read(SHIPPED)
