"""Tables of times, memory and compilation."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from iprt.device.budget import amount
from iprt.files.message_text import counted
from iprt.measure.changes import FALSE_ALARMS, Change
from iprt.measure.cost import PartRow, PassRow, RayRow, Timing, WorkRow
from iprt.measure.cost_report import CostReport
from iprt.measure.results import grid_of
from iprt.output.grid import Grid

WORTH_A_ROW = 0.01
"""Least share of the total for which a buffer or program has its own row."""
CHANGED = "*"
NAME = "per frame"
"""Column of the names of passes and their parts."""
Row = dict[str, str]


def pass_grid(report: CostReport) -> Grid:
    """Build a table of milliseconds per frame and pass, with one-time costs in the notes."""
    rows = [_sum(report), *map(_pass_row, report.passes)]
    return grid_of(_title(report), rows, *_notes(report))


def part_grid(report: CostReport) -> Grid:
    """Build a table of passes with their kernels, transfers and host work, and counted work."""
    rows = [_sum(report)]
    for row in report.passes:
        rows += [_pass_row(row), *map(_part_row, row.parts)]
    return grid_of(
        _title(report),
        rows,
        *_notes(report),
        "ms, p95, mean: of the frames; the medians (ms) of parts do not add up to the pass's",
        "host: time of the host on a pass while the device may be running; work that the host does "
        "itself counts in ms. As both run at once, the sum may exceed the wall time",
        "MB: buffers bound to a kernel, each counted once, or bytes transferred; GB/s: MB by time, "
        "except for kernels that read where rays or lists lead",
        "steps: mean per ray; most: of the longest ray; active: work items that have work; groups: "
        "work groups that hold any (tiles, for passes over pixels)",
    )


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
        old, new, noise = change.before_ms, change.after_ms, change.noise_ms
        rows.append(
            {
                "median ms/frame": f"  {change.part}" if change.part else change.name,
                "before": "" if old is None else f"{old:.3f}",
                "now": "" if new is None else f"{new:.3f}",
                "change": f"{change.difference_ms:+.3f}",
                "%": f"{100 * change.difference_ms / old:+.1f}" if old and new is not None else "",
                "noise": "" if noise is None else f"±{noise:.3f}",
                "": CHANGED if change.beyond_noise else "",
            }
        )
    return grid_of(
        f"against {before}",
        rows,
        f"{CHANGED}: in one of them only, or beyond the noise within both: where nothing changed, "
        f"one row or more is marked in {FALSE_ALARMS:.0%} of comparisons",
        "a machine that is busier in one of them shifts all rows",
        *settings,
    )


def _title(report: CostReport) -> str:
    view = report.view
    return (
        f"{view.width}x{view.height}, method {report.settings['method']}, "
        f"{counted(report.frames, 'frame')} on {report.device}"
    )


def _notes(report: CostReport) -> list[str]:
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
    return notes


def _sum(report: CostReport) -> Row:
    share, host = (sum(getattr(p, key) for p in report.passes) for key in ("share", "enqueue_ms"))
    return _row("all passes", report.frame, share, host, report.launches)


def _pass_row(row: PassRow) -> Row:
    return _row(row.name, row.timing, row.share, row.enqueue_ms, row.launches)


def _part_row(part: PartRow) -> Row:
    return {
        **_row(f"  {part.name}", part.timing, part.share, None, part.launches),
        "MB": f"{part.bytes / 1e6:.2f}" if part.bytes else "",
        "GB/s": "" if part.gb_per_s is None else f"{part.gb_per_s:.2f}",
        **({} if part.work is None else _work(part.work)),
    }


def _row(name: str, timing: Timing, share: float, host: float | None, launches: float) -> Row:
    return {
        NAME: name,
        "ms": f"{timing.ms:.2f}",
        "p95": f"{timing.p95_ms:.2f}",
        "mean": f"{timing.mean_ms:.2f}",
        "share": f"{share:.1%}",
        "host": "" if host is None else f"{host:.2f}",
        "launches": f"{launches:.4g}",
    }


def _work(work: WorkRow) -> Row:
    return {
        **_rays(work.real, "rays", "steps", "most"),
        **_rays(work.objects, "object rays", "object steps", "object most"),
        "active": f"{work.active:.0f}/{work.items:.0f}",
        "groups": f"{work.active_groups:.0f}/{work.groups:.0f}",
    }


def _rays(rays: RayRow, *columns: str) -> Row:
    cells = (f"{rays.count:.0f}", f"{rays.steps:.1f}", str(rays.most)) if rays.count else [""] * 3
    return dict(zip(columns, cells, strict=True))


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
