"""Report of the costs of a sequence of frames, as a whole and by pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from iprt import __version__
from iprt.geometry.camera import View
from iprt.measure.cost import (
    Counted,
    PassRow,
    Timing,
    frame_timing,
    pass_rows,
)
from iprt.settings.model import Settings

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.device.profile import Profile

SCHEMA = 1
"""Version of the plain data. Raise it when the meaning of an existing field changes."""


@dataclass(frozen=True)
class CostReport:
    """Costs of a sequence of frames.

    Attributes
    ----------
    scene, device : str
        Names.
    view : View
        View of the first frame.
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
    """

    scene: str
    device: str
    view: View
    settings: Settings
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
            settings=settings,
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

    def record(self) -> dict[str, Any]:
        """Return the report as plain data for JSON."""
        return {
            "schema": SCHEMA,
            "version": __version__,
            "scene": self.scene,
            "device": self.device,
            "view": asdict(self.view),
            "method": self.settings.method,
            "width": self.view.width,
            "height": self.view.height,
            "frames": self.frames,
            **_timing(self.wall, "wall_"),
            **_timing(self.host, "host_"),
            "synchronisations": self.synchronisations,
            **_timing(self.frame),
            "traced": self.traced,
            "prepare_ms": self.prepare_ms,
            "compile_ms": self.compile_ms,
            "compiled": dict(self.compiled),
            "first_launches": dict(self.first_launches),
            "passes": [_pass_record(row) for row in self.passes],
            "memory": self.memory,
            "buffers": dict(self.buffers),
            "settings": self.settings.model_dump(mode="json"),
        }

    def flat(self) -> list[dict[str, Any]]:
        """Return rows of plain values per pass (no `part`), part and program (no `pass`).

        All rows have the same keys.
        """
        rows: list[dict[str, Any]] = []
        for row in map(_pass_record, self.passes):
            parts = row.pop("parts")
            name = row.pop("name")
            rows.append({"pass": name, "part": "", "kind": "pass", **row})
            rows += [
                {"pass": name, "part": part.pop("name"), **part, **(part["work"] or {})}
                for part in parts
            ]
        rows += [
            {
                "pass": "",
                "part": program,
                "kind": "program",
                "build_ms": self.compiled.get(program, 0.0),
                "first_launch_ms": self.first_launches.get(program, 0.0),
            }
            for program in {**self.compiled, **self.first_launches}
        ]
        names = dict.fromkeys(name for row in rows for name in row if name != "work")
        return [{name: row.get(name) for name in names} for row in rows]


def _pass_record(row: PassRow) -> dict[str, Any]:
    record = asdict(row)
    return _plain({**record, "parts": [_plain(part) for part in record["parts"]]})


def _plain(record: dict[str, Any]) -> dict[str, Any]:
    """Flatten a row: name and kind first, then the fields of its timing, then the others."""
    named = {"name": record.pop("name")}
    if "kind" in record:
        named["kind"] = record.pop("kind").value
    return {**named, **record.pop("timing"), **record}


def _timing(timing: Timing | None, prefix: str = "") -> dict[str, float | None]:
    names = ("ms", "p95_ms", "mean_ms", "error_ms")
    return {prefix + name: getattr(timing, name, None) for name in names}
