"""Flags shared by the verbs that score still pictures against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from iprt.commands.flag_types import Size, listed
from iprt.commands.help import plain_default
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.commands.measurement import Output
    from iprt.commands.setting_flags import SettingFlags
    from iprt.measure.measurement import Measurement
    from iprt.scene.scene import Scene

MAX_SEEDS = 100
MAX_FRAMES = 100_000


@dataclass(frozen=True)
class MeasurementFlags:
    """Subject, device and output of a measurement."""

    view: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], plain_default("NAME")] = ()
    """Views to measure, separated by commas or with --view again. Default: all with a truth."""
    size: Annotated[Size, plain_default()] = None
    """Width and height in pixels: the truth's, divided by an integer. Default: the truth's."""
    background: Literal["panorama", "truth"] = "truth"
    """Background behind the objects: the resampled panorama, or the truth's own."""
    device: Annotated[str | None, plain_default("DEVICE")] = None
    """gpu, cpu, PLATFORM:DEVICE or part of a name. Default: $IPRT_DEVICE, or the fastest."""
    json: Annotated[bool, plain_default()] = False
    """Print a JSON object instead of tables."""
    markdown: Annotated[bool, plain_default()] = False
    """Print Markdown tables."""
    html: Annotated[Path | None, plain_default()] = None
    """HTML file to write a report to: tables, plots and pictures."""
    allow_outside: Annotated[bool, plain_default()] = False
    """Follow symbolic links that lead out of the scene folder."""

    @property
    def output(self) -> Output:
        """Output of the results."""
        from iprt.commands.measurement import Output

        return Output(self.json, self.markdown, self.html)

    def open(self, folder: Path) -> Scene:
        """Open the scene.

        Raises
        ------
        IprtError
            The scene cannot be read, flags contradict each other, or the report cannot be written.
        """
        from iprt.files.atomic import require_writable
        from iprt.scene.scene import Scene

        if self.json and self.markdown:
            raise IprtError("--json and --markdown: give one of them")
        scene = Scene.open(folder, allow_outside=self.allow_outside)
        if self.html is not None:
            require_writable(self.html)
            scene.require_not_ours(self.html)
        return scene

    def plan(
        self,
        folder: Path,
        setting_flags: SettingFlags,
        *,
        method: str | None = None,
        sweep: SweepFlags | None = None,
        seeds: int = 1,
    ) -> Measurement:
        """Open the scene, read the truths of the views and open the device.

        Parameters
        ----------
        method : str, optional
            Relighting method, in place of the one in `setting_flags`.
        sweep : SweepFlags, optional
            Settings to vary; without it, only `setting_flags` are measured.

        Raises
        ------
        IprtError
            The scene cannot be opened (see `open`), or a setting, view, size or device cannot be
            used.
        """
        from iprt.device.choose import choose_device
        from iprt.device.compute import ComputeDevice
        from iprt.measure.combinations import combinations
        from iprt.measure.measurement import Measurement
        from iprt.measure.view_truth import read_target, views_with_truth

        scene = self.open(folder)
        if not 1 <= seeds <= MAX_SEEDS:
            raise IprtError(f"--seeds {seeds}: expected 1 to {MAX_SEEDS}")
        sweep = sweep or SweepFlags()
        sweep.check()
        chosen = combinations(
            setting_flags.quality,
            setting_flags.assignments(scene, method=method),
            sweep.sweep,
            one_at_a_time=sweep.one_at_a_time,
        )
        names = dict.fromkeys(views_with_truth(scene, listed(self.view)))
        targets = tuple(read_target(scene, name, self.background, self.size) for name in names)
        device = ComputeDevice(choose_device(self.device))
        return Measurement(scene, targets, tuple(chosen), device, seeds, self.background)


@dataclass(frozen=True)
class SweepFlags:
    """Settings to vary."""

    sweep: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]], plain_default("KEY=VALUE,VALUE,...")
    ] = ()
    """Values of a setting to compare, such as trace.rays=1,2. Repeat it for all combinations."""
    one_at_a_time: Annotated[bool, plain_default()] = False
    """Change one swept setting at a time, instead of measuring all combinations."""

    def check(self) -> None:
        """Refuse a flag without effect.

        Raises
        ------
        IprtError
        """
        if self.one_at_a_time and not self.sweep:
            raise IprtError("--one-at-a-time: needs --sweep")


def check_count(flag: str, count: int) -> None:
    """Refuse a number of frames out of range.

    Raises
    ------
    IprtError
    """
    if not 1 <= count <= MAX_FRAMES:
        raise IprtError(f"{flag} {count}: expected 1 to {MAX_FRAMES}")


Measured = Annotated[MeasurementFlags, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="measurement")]
"""`MeasurementFlags` as a parameter of a verb."""
Swept = Annotated[SweepFlags, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="sweep")]
"""`SweepFlags` as a parameter of a verb."""
EVERY_VIEW = MeasurementFlags()
NO_SWEEP = SweepFlags()
