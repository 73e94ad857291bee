"""Tables of times, memory and compilation."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from iprt.device.budget import amount
from iprt.files.message_text import counted
from iprt.measure.changes import FALSE_ALARMS, Change
from iprt.measure.cost import PartRow, PassRow, Timing, WorkRow
from iprt.measure.cost_report import CostReport
from iprt.output.grid import Grid

TIMES = ("ms", "p95", "mean", "share", "host", "launches")
WORK = ("MB", "GB/s", "rays", "steps", "most", "object rays", "steps", "most", "active", "groups")
WORTH_A_ROW = 0.01
"""Least share of the total for which a buffer or program has its own row."""
CHANGED = "*"


def pass_grid(report: CostReport) -> Grid:
    """Build a table of milliseconds per frame and pass, with one-time costs in the notes."""
    rows = [("all passes", *_times(report.frame, _sum(report.passes)))]
    rows += [(row.name, *_pass_times(row)) for row in report.passes]
    return Grid(_title(report), ("per frame", *TIMES), tuple(rows), _notes(report))


def part_grid(report: CostReport) -> Grid:
    """Build a table of passes with their kernels, transfers and host work, and counted work."""
    empty = ("",) * len(WORK)
    rows = [("all passes", *_times(report.frame, _sum(report.passes)), *empty)]
    for row in report.passes:
        rows.append((row.name, *_pass_times(row), *empty))
        rows += [(f"  {part.name}", *_part_cells(part)) for part in row.parts]
    notes = (
        *_notes(report),
        "ms, p95, mean: of the frames; medians (ms) of parts do not add up to that of the whole",
        "host: time of the host on a pass while the device may be running; work that the host does "
        "itself counts in ms. As both run at once, the sum may exceed the wall time",
        "MB: buffers bound to a kernel, each counted once, or bytes transferred; GB/s: MB by time, "
        "except for kernels that read where rays or lists lead",
        "steps: mean per ray; most: of the longest ray; active: work items that have work; groups: "
        "work groups that hold any (tiles, for passes over pixels)",
    )
    return Grid(_title(report), ("per frame", *TIMES, *WORK), tuple(rows), notes)


def memory_grid(report: CostReport) -> Grid:
    """Build a table of buffer sizes, largest first, with small ones combined."""
    total = sum(report.buffers.values())
    ranked = sorted(report.buffers.items(), key=lambda entry: -entry[1])
    rows = _ranked([(name, (size,)) for name, size in ranked], lambda size: f"{size / 2**20:.2f}")
    opengl = sum(size for name, size in ranked if name.startswith("OpenGL"))
    besides = f", and {amount(opengl)} of OpenGL's" if opengl else ""
    note = f"{amount(total - opengl)} of the device's {amount(report.memory)}{besides}"
    return Grid("memory", ("buffer", "MiB", "share"), rows, (note,))


def compile_grid(report: CostReport) -> Grid:
    """Build a table of compile times by source file, with all variants of a file combined."""
    files: dict[str, tuple[float, ...]] = {}
    for program in {**report.compiled, **report.first_launches}:
        file = program.partition(" ")[0]
        built, launched = files.get(file, (0.0, 0.0))
        built += report.compiled.get(program, 0.0)
        files[file] = (built, launched + report.first_launches.get(program, 0.0))
    ranked = sorted(files.items(), key=lambda entry: -sum(entry[1]))
    rows = _ranked(ranked, lambda ms: f"{ms:.0f}")
    notes = (
        f"{report.compile_ms:.0f} ms, once",
        "first launch: time that the first launches took longer; drivers such as PoCL compile then",
    )
    return Grid("compiling", ("program", "build ms", "first launch ms", "share"), rows, notes)


def change_grid(changes: Sequence[Change], settings: Sequence[str], before: str) -> Grid:
    """Build a table of changes since the report named `before`.

    `settings` describes the settings that differ.
    """
    rows = []
    for change in changes:
        indented = f"  {change.part}" if change.part else change.name
        old, new = change.before_ms, change.after_ms
        rows.append(
            (
                indented,
                "" if old is None else f"{old:.3f}",
                "" if new is None else f"{new:.3f}",
                f"{change.difference_ms:+.3f}",
                f"{change.difference_ms / old:+.1%}" if old and new is not None else "",
                "" if change.noise_ms is None else f"±{change.noise_ms:.3f}",
                CHANGED if change.beyond_noise else "",
            )
        )
    notes = (
        f"{CHANGED}: in one of them only, or beyond the noise within both: where nothing changed, "
        f"one row or more is marked in {FALSE_ALARMS:.0%} of comparisons",
        "a machine that is busier in one of them shifts all rows",
        *settings,
    )
    columns = ("median ms/frame", "before", "now", "change", "", "noise", "")
    return Grid(f"against {before}", columns, tuple(rows), notes)


def _title(report: CostReport) -> str:
    view = report.view
    return (
        f"{view.width}x{view.height}, method {report.settings.method}, "
        f"{counted(report.frames, 'frame')} on {report.device}"
    )


def _notes(report: CostReport) -> tuple[str, ...]:
    notes = []
    if report.wall is not None:
        wall = report.wall
        notes.append(
            f"wall: {wall.ms:.2f} ms/frame (p95 {wall.p95_ms:.2f}), {1e3 / wall.ms:.1f} frames/s"
        )
    if report.host is not None:
        notes.append(
            f"host: {report.host.ms:.2f} ms/frame of the thread that asks for frames, "
            f"{report.launches:.4g} launches, "
            f"{report.synchronisations:.4g} synchronisations with the device"
        )
    if report.traced is not None:
        notes.append(f"real surfaces relit by rays at {report.traced:.1%} of the pixels")
    notes.append(
        f"once: compiling kernels {report.compile_ms:.0f} ms, "
        f"preparing the panorama {report.prepare_ms:.0f} ms"
    )
    return tuple(notes)


def _sum(passes: Sequence[PassRow]) -> tuple[float, float, float]:
    """Sum share, enqueue milliseconds and launches of passes."""
    return (
        sum(row.share for row in passes),
        sum(row.enqueue_ms for row in passes),
        sum(row.launches for row in passes),
    )


def _pass_times(row: PassRow) -> tuple[str, ...]:
    return _times(row.timing, (row.share, row.enqueue_ms, row.launches))


def _times(timing: Timing, others: tuple[float, float | None, float]) -> tuple[str, ...]:
    share, host, launches = others
    return (
        f"{timing.ms:.2f}",
        f"{timing.p95_ms:.2f}",
        f"{timing.mean_ms:.2f}",
        f"{share:.1%}",
        "" if host is None else f"{host:.2f}",
        f"{launches:.4g}",
    )


def _part_cells(part: PartRow) -> tuple[str, ...]:
    return (
        *_times(part.timing, (part.share, None, part.launches)),
        f"{part.bytes / 1e6:.2f}" if part.bytes else "",
        "" if part.gb_per_s is None else f"{part.gb_per_s:.2f}",
        *_work_cells(part.work),
    )


def _work_cells(work: WorkRow | None) -> tuple[str, ...]:
    if work is None:
        return ("",) * (len(WORK) - 2)
    real = _rays(work.rays, work.steps, work.most_steps)
    objects = _rays(work.object_rays, work.object_steps, work.most_object_steps)
    active = f"{work.active:.0f}/{work.items:.0f}"
    groups = f"{work.active_groups:.0f}/{work.groups:.0f}"
    return (*real, *objects, active, groups)


def _rays(count: float, steps: float, most: int) -> tuple[str, str, str]:
    return (f"{count:.0f}", f"{steps:.1f}", str(most)) if count else ("", "", "")


def _ranked(
    ranked: Sequence[tuple[str, tuple[float, ...]]], text: Callable[[float], str]
) -> tuple[tuple[str, ...], ...]:
    """Format rows of name, values and share of the total, with small entries combined last."""
    total = sum(sum(values) for _, values in ranked)
    named = [entry for entry in ranked if sum(entry[1]) >= WORTH_A_ROW * total]
    others = [values for _, values in ranked[len(named) :]]
    if others:
        named.append((f"{len(others)} others", tuple(map(sum, zip(*others, strict=True)))))
    return tuple(
        (name, *map(text, values), f"{sum(values) / total:.1%}" if total else "")
        for name, values in named
    )
