"""The user's own trade-off tables, one per device, in the cache folder."""

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
    """Identity of a timed device.

    Times are valid for one device, driver and version of iprt.

    Attributes
    ----------
    device : str
        Names of the device and its platform.
    driver : str
        Driver version.
    """

    device: str
    driver: str

    @classmethod
    def of(cls, device: cl.Device) -> Self:
        """Read the identity of a pyopencl device."""
        name, platform = device.name.strip(), device.platform.name.strip()
        return cls(f"{name} ({platform})", device.driver_version.strip())

    @property
    def file(self) -> Path:
        """Path of the device's table."""
        digest = hashlib.blake2b(self.device.encode(), digest_size=10).hexdigest()
        return own_folder() / "tradeoff" / f"{digest}.toml"

    def made(self, table: Tradeoff) -> bool:
        """Return True if the table is from this device, driver and version of iprt."""
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
    """Return the device's own table if it is valid, else the shipped one.

    A table that cannot be read, or is from another driver or version, is ignored with a warning.
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
