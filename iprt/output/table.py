"""Where the time went: per-pass times as a table for people and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.table import Table

from iprt.device.profile import Profile
from iprt.output.atomic import replacing


@dataclass(frozen=True)
class PassRow:
    """One pass, per frame.

    Attributes
    ----------
    name : str
    ms, device_ms, host_ms : float
        Milliseconds per frame: total, by device events, and host work.
    share : float
        Fraction of the total of all passes, in [0, 1].
    launches : float
        Kernel launches and transfers per frame.
    """

    name: str
    ms: float
    share: float
    device_ms: float
    host_ms: float
    launches: float


def pass_rows(profile: Profile) -> list[PassRow]:
    """Rows per pass of a resolved profile, in the order in which the passes first ran."""
    passes = profile.passes()
    frames = max(profile.frames, 1)
    total = sum(entry.ms for entry in passes)
    return [
        PassRow(
            name=entry.name,
            ms=entry.ms / frames,
            share=entry.ms / total if total > 0.0 else 0.0,
            device_ms=entry.device_ms / frames,
            host_ms=entry.host_ms / frames,
            launches=entry.launches / frames,
        )
        for entry in passes
    ]


def pass_table(profile: Profile, device: str, *, prepare_ms: float) -> Table:
    """A table of milliseconds per frame and pass; what is done once stands in its caption.

    Parameters
    ----------
    prepare_ms : float
        Time spent once per video frame, before the first of the frames that `profile` covers.
    """
    return rows_table(
        pass_rows(profile),
        title=f"{profile.frames} frames on {device}",
        caption=(
            f"once: compiling kernels {profile.compile_ms:.0f} ms, "
            f"preparing the panorama {prepare_ms:.0f} ms"
        ),
    )


def rows_table(rows: Sequence[PassRow], *, title: str, caption: str) -> Table:
    """A table of passes with the sums of their columns."""
    table = Table(
        title=title,
        caption=caption,
        title_justify="left",
        caption_justify="left",
        show_footer=True,
    )
    table.add_column("pass", "sum")
    sums = (
        ("ms/frame", f"{sum(row.ms for row in rows):.2f}"),
        ("share", ""),
        ("device", f"{sum(row.device_ms for row in rows):.2f}"),
        ("host", f"{sum(row.host_ms for row in rows):.2f}"),
        ("launches/frame", f"{sum(row.launches for row in rows):.4g}"),
    )
    for header, footer in sums:
        table.add_column(header, footer, justify="right")
    for row in rows:
        table.add_row(
            row.name,
            f"{row.ms:.2f}",
            f"{row.share:.1%}",
            f"{row.device_ms:.2f}",
            f"{row.host_ms:.2f}",
            f"{row.launches:.4g}",
        )
    return table


def profile_record(profile: Profile, device: str, *, prepare_ms: float) -> dict[str, object]:
    """The same numbers as plain data: `device, frames, compile_ms, prepare_ms, ms, passes`."""
    rows = pass_rows(profile)
    return {
        "device": device,
        "frames": profile.frames,
        "compile_ms": profile.compile_ms,
        "prepare_ms": prepare_ms,
        "ms": sum(row.ms for row in rows),
        "passes": [asdict(row) for row in rows],
    }


def write_profile(path: Path, profile: Profile, device: str, *, prepare_ms: float) -> None:
    """Write `profile_record` as JSON, atomically.

    Raises
    ------
    FormatError
        The file cannot be written.
    """
    text = json.dumps(profile_record(profile, device, prepare_ms=prepare_ms), indent=2)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
