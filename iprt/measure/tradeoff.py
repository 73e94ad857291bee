"""Trade-off table: time and SSIM of the ladder's entries, and the choice of an entry.

A table holds measurements on one device for several views: the seconds of a frame, as
fixed + per_pixel · pixels, and the SSIM after several numbers of frames. An estimate is the mean
over the views, with the minimum and the maximum.
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
from iprt.files.message_text import printable
from iprt.files.toml_text import parse_toml, read_text
from iprt.settings.ladder import LADDER

SHIPPED = Path(__file__).with_name("tradeoff.toml")
"""The package's table, made by
`iprt calibrate scenes360/room --ssim -o iprt/measure/tradeoff.toml`."""
MOST_S = 1e6
"""Upper bound for plausible seconds of a frame."""

Seconds = Annotated[float, Field(ge=0.0, le=MOST_S)]
Positive = Annotated[float, Field(gt=0.0, le=MOST_S)]
Similarity = Annotated[float, Field(ge=-1.0, le=1.0)]
Count = Annotated[int, Field(ge=1, le=2**20)]


@dataclass(frozen=True)
class Range:
    """Mean, minimum and maximum over views."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: list[float]) -> Range:
        """Compute the range of at least one value."""
        return cls(math.fsum(values) / len(values), min(values), max(values))

    def scaled(self, factor: float) -> Range:
        """Return the range in another unit, multiplied by `factor`."""
        return Range(factor * self.mean, factor * self.low, factor * self.high)

    def text(self, digits: int) -> str:
        """Format the range with significant `digits`, such as `0.078 (0.071 to 0.085)`."""
        mean, low, high = (f"{value:.{digits}g}" for value in (self.mean, self.low, self.high))
        return mean if low == high else f"{mean} ({low} to {high})"


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Entry(_Table):
    """Measurements of one entry of the ladder.

    Attributes
    ----------
    name : str
        Key in `LADDER`.
    ratio : list of float
        Frame time of the largest pictures relative to the entry `balanced`: geometric mean over
        the views, and the lowest and highest ends of their confidence intervals.
    seconds : dict of str to list of float
        Fixed seconds of a frame and seconds per pixel, by view.
    ssim : dict of str to list of float
        Mean SSIM of the cuts after each of the table's numbers of frames, by view.
    """

    name: str
    ratio: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    seconds: Annotated[
        dict[str, Annotated[list[Seconds], Field(min_length=2, max_length=2)]], Field(min_length=1)
    ]
    ssim: Annotated[dict[str, list[Similarity]], Field(min_length=1)]

    def seconds_of(self, pixels: int) -> Range:
        """Estimate the seconds of a frame of `pixels` pixels."""
        return Range.of([fixed + slope * pixels for fixed, slope in self.seconds.values()])

    def ssim_after(self, frames: int, measured: list[int]) -> Range:
        """Estimate the SSIM of a picture of `frames` frames.

        SSIM is interpolated linearly in the logarithm of the number of frames between the
        `measured` ones, and is constant beyond them.
        """
        at = [math.log(count) for count in measured]
        values = [float(np.interp(math.log(frames), at, line)) for line in self.ssim.values()]
        return Range.of(values)


class Tradeoff(_Table):
    """Measurements of all entries on a device.

    Attributes
    ----------
    version : str
        Version of iprt.
    device, driver : str
        See `TimedDevice`.
    scene : str
        Scene of the timed views.
    truth : str
        Scene of the views with SSIM.
    frames : list of int
        Numbers of frames after which SSIM was measured, rising.
    entries : list of Entry
        Entries in the order of `LADDER`.
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
            raise ValueError("its entries differ from this version's")
        if self.frames != sorted(set(self.frames)):
            raise ValueError("frames: expected rising numbers")
        for entry in self.entries:
            if any(len(line) != len(self.frames) for line in entry.ssim.values()):
                raise ValueError(f"entry '{entry.name}': expected an SSIM for each of frames")
        return self

    @classmethod
    def parse(cls, text: str) -> Tradeoff:
        """Parse a table from TOML.

        Raises
        ------
        ValueError
            The text is not a valid table. The message is one line.
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
        """Read a table from a file.

        Raises
        ------
        FormatError
            The file cannot be read, or is not a valid table.
        """
        try:
            return cls.parse(read_text(path))
        except OSError as error:
            raise FormatError(f"{path}: cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise FormatError(f"{path}: {error}") from None

    def text(self, title: str) -> str:
        """Format the table as TOML, with `title` as a leading comment."""
        return f"# {title}\n{tomlkit.dumps(self.model_dump())}"

    def ssim(self, entry: Entry, frames: int) -> Range:
        """Estimate the SSIM of an entry's picture of `frames` frames."""
        return entry.ssim_after(frames, self.frames)

    def within(self, seconds: float, pixels: int, frames: int) -> tuple[Entry, bool]:
        """Choose the most accurate entry with at most `seconds` per frame, else the fastest one.

        Returns
        -------
        Entry
        bool
            True if the estimated time is within `seconds`.
        """
        fitting = [e for e in self.entries if e.seconds_of(pixels).mean <= seconds]
        if fitting:
            return max(fitting, key=lambda entry: self.ssim(entry, frames).mean), True
        return min(self.entries, key=lambda entry: entry.seconds_of(pixels).mean), False

    def reaching(self, ssim: float, pixels: int, frames: int) -> tuple[Entry, bool]:
        """Choose the fastest entry with a mean SSIM of at least `ssim`, else the most accurate one.

        Returns
        -------
        Entry
        bool
            True if the estimated SSIM is at least `ssim`.
        """
        enough = [entry for entry in self.entries if self.ssim(entry, frames).mean >= ssim]
        if enough:
            return min(enough, key=lambda entry: entry.seconds_of(pixels).mean), True
        return max(self.entries, key=lambda entry: self.ssim(entry, frames).mean), False


@cache
def shipped() -> Tradeoff:
    """Return the table that comes with the package."""
    return Tradeoff.read(SHIPPED)
