"""The user's own tables of what time buys, one per device, in the cache folder."""

from __future__ import annotations

import hashlib
import logging
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from iprt import __version__
from iprt.device.caches import own_folder
from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.measure.tradeoff import Tradeoff, shipped

if TYPE_CHECKING:
    import pyopencl as cl

LOG = logging.getLogger("iprt.measure")


@dataclass(frozen=True)
class TimedDevice:
    """What times hold for, besides the version of iprt.

    Attributes
    ----------
    device : str
        Names of the device and of its platform.
    driver : str
        Version of the driver.
    """

    device: str
    driver: str

    @classmethod
    def of(cls, device: cl.Device) -> Self:
        name, platform = device.name.strip(), device.platform.name.strip()
        return cls(f"{name} ({platform})", device.driver_version.strip())

    @property
    def file(self) -> Path:
        """Where the device's table is kept."""
        digest = hashlib.blake2b(self.device.encode(), digest_size=10).hexdigest()
        return own_folder() / "tradeoff" / f"{digest}.toml"

    def made(self, table: Tradeoff) -> bool:
        """Whether the table's times are those of this device, driver and version of iprt."""
        now = (self.device, self.driver, __version__)
        return (table.device, table.driver, table.version) == now


def keep(table: Tradeoff, path: Path) -> None:
    """Write a table.

    Raises
    ------
    FormatError
        The file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(table.text("Measured by `iprt calibrate`."), encoding="utf-8")


def tradeoff_for(timed: TimedDevice) -> Tradeoff:
    """The device's own table, or the shipped one where there is none that holds.

    One that cannot be read, or is of another driver or version, is ignored with a warning.
    """
    file = timed.file
    if not os.path.lexists(file):
        return shipped()
    again = "is ignored; run `iprt calibrate` to measure this device again"
    try:
        table = Tradeoff.read(file)
    except FormatError as error:
        LOG.warning("%s; it %s", error, again)
        return shipped()
    if not timed.made(table):
        LOG.warning("%s: is of another driver or version of iprt and %s", file, again)
        return shipped()
    return table
