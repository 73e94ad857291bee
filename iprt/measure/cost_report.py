"""Report of the costs of a sequence of frames, as a whole and by pass, and its JSON file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import TypeAdapter, ValidationError

from iprt import __version__
from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.geometry.camera import View
from iprt.measure.cost import Counted, PassRow, Timing, frame_timing, pass_rows
from iprt.measure.results import json_text

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.device.profile import Profile
    from iprt.settings.model import Settings


@dataclass(frozen=True)
class CostReport:
    """Costs of a sequence of frames.

    Attributes
    ----------
    scene, device : str
        Names.
    view : View
        View of the first frame.
    settings : mapping of str to object
        All settings, as plain data.
    wall : Timing or None
        Wall time from the request of a frame until the device has finished it: passes, Python and
        waiting. The picture stays on the device. None if pictures were read.
    host : Timing or None
        CPU time of the requesting thread. None if `wall` is None.
    synchronisations : float or None
        Number of waits of that thread for the device, per frame, before the frame's end.
    frame : Timing
        All passes of a frame together.
    traced : float or None
        Fraction of the pixels at which rays relight the real surface. None if no rays are traced,
        or the fraction was not measured.
    prepare_ms : float
        Time of passes before the first frame.
    compiled, first_launches : mapping of str to float
        Milliseconds by program; see `Profile`.
    buffers : mapping of str to int
        Bytes by name, including OpenGL's memory.
    memory : int
        Bytes of the device's memory.
    schema : int
        Version of the file. Raise it when the meaning of an existing field changes.
    version : str
        Version of iprt.
    """

    scene: str
    device: str
    view: View
    settings: Mapping[str, Any]
    frames: int
    wall: Timing | None
    host: Timing | None
    synchronisations: float | None
    frame: Timing
    traced: float | None
    prepare_ms: float
    compiled: Mapping[str, float]
    first_launches: Mapping[str, float]
    passes: tuple[PassRow, ...]
    buffers: Mapping[str, int]
    memory: int
    schema: Literal[2] = 2
    version: str = __version__

    @classmethod
    def of(
        cls,
        device: ComputeDevice,
        *,
        scene: str,
        view: View,
        settings: Settings,
        prepare_ms: float,
        walls: Sequence[float] = (),
        hosts: Sequence[float] = (),
        synchronisations: float | None = None,
        traced: float | None = None,
    ) -> CostReport:
        """Build the report of the frames in the device's profile, at least one.

        Parameters
        ----------
        walls, hosts : sequences of float
            Milliseconds of each frame; see `wall` and `host`.
        synchronisations : float or None
            See the attribute.
        """
        profile = device.profile
        frames = profile.kept_frames()
        return cls(
            scene=scene,
            device=device.name,
            view=view,
            settings=settings.model_dump(mode="json"),
            frames=profile.frames,
            wall=Timing.of(walls) if walls else None,
            host=Timing.of(hosts) if hosts else None,
            synchronisations=synchronisations,
            frame=frame_timing(frames),
            traced=traced,
            prepare_ms=prepare_ms,
            compiled=dict(profile.compiled),
            first_launches=dict(profile.first_launches),
            passes=tuple(pass_rows(frames)),
            buffers={**device.buffers, **device.opengl},
            memory=device.memory,
        )

    def with_work(self, profile: Profile, counted: Counted) -> CostReport:
        """Return the report with the counted work of kernels; `profile` is the report's own."""
        return replace(self, passes=tuple(pass_rows(profile.kept_frames(), counted)))

    @property
    def compile_ms(self) -> float:
        """Total time in ms to compile all programs, in builds and first launches."""
        return sum(self.compiled.values()) + sum(self.first_launches.values())

    @property
    def launches(self) -> float:
        """Launches of kernels and transfers per frame."""
        return sum(row.launches for row in self.passes)

    @property
    def wall_ms(self) -> float:
        """Median wall time. `wall` must not be None."""
        assert self.wall is not None
        return self.wall.ms


def write_report(path: Path, report: CostReport) -> None:
    """Write a report as JSON, atomically.

    Raises
    ------
    FormatError
        The file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(json_text(report) + "\n", encoding="utf-8")


def read_report(path: Path) -> CostReport:
    """Read a file of `iprt profile --json`, `iprt bench --json` or `iprt render --profile`.

    Raises
    ------
    FormatError
        The file cannot be read, or has another format.
    """
    try:
        return TypeAdapter(CostReport).validate_json(path.read_bytes())
    except OSError as error:
        raise FormatError(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = "".join(f"{part}: " for part in first["loc"])
        raise FormatError(
            f"{path}: {place}{first['msg']}; expected the output of `iprt profile --json` by this "
            "version"
        ) from error
