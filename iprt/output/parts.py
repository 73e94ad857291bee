"""Folder beside a film, `NAME.parts`, with its plan and its finished parts until it is whole."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.output.film_plan import FilmPlan
from iprt.output.metadata import difference

SUFFIX = ".parts"
PLAN, DEVICE = "film.json", "device.txt"


class Parts:
    """The folder of a film's parts.

    Several processes may use it at the same time, on several machines. Files appear whole, and
    processes that write the same file write the same bytes.

    Attributes
    ----------
    path : Path
    """

    def __init__(self, output: Path) -> None:
        self.path = parts_of(output)

    def open(self, plan: FilmPlan) -> None:
        """Create the folder for a film, or check that it is of this film.

        Raises
        ------
        FormatError
            It is of another film or not ours, or cannot be written.
        """
        file = self.path / PLAN
        if self.path.is_symlink():
            raise FormatError(f"{self.path}: is a symbolic link; move it, or name another output")
        if not file.exists():
            if self.path.exists() and any(self.path.glob("[0-9]*")):
                raise FormatError(
                    f"{self.path}: was not made by iprt; move it, or name another output"
                )
            with replacing(file) as temporary:
                temporary.write_text(plan.to_json(), "utf-8")
        differs = difference(self.plan().identity, plan.identity)
        if differs is not None:
            raise FormatError(
                f"{self.path}: holds finished frames of another render: {differs}; delete this "
                "folder to start again, or name another output"
            )

    def plan(self) -> FilmPlan:
        """Return the plan of the film.

        Raises
        ------
        FormatError
            It cannot be read.
        """
        try:
            return FilmPlan.from_json((self.path / PLAN).read_text("utf-8"))
        except (OSError, ValueError) as error:
            raise FormatError(
                f"{self.path / PLAN}: cannot be read; delete the folder it is in"
            ) from error

    def other_device(self, name: str) -> str | None:
        """Record the device that renders; return the name of another one that did before."""
        file = self.path / DEVICE
        try:
            before = file.read_text("utf-8")
        except FileNotFoundError:
            with replacing(file) as temporary:
                temporary.write_text(name, "utf-8")
            return None
        return None if before == name else before

    def clean(self) -> None:
        """Remove what killed processes left. No other process may use the folder."""
        for path in self.path.glob(".*.tmp"):
            path.unlink()

    def remove(self) -> None:
        """Remove the folder, the plan last: without it, parts belong to no film."""
        with suppress(OSError):
            for path in self.path.iterdir():
                if path.name != PLAN:
                    path.unlink(missing_ok=True)
            shutil.rmtree(self.path)


def parts_of(output: Path) -> Path:
    """Return the folder that holds the finished parts of a film."""
    return output.with_name(output.name + SUFFIX)
