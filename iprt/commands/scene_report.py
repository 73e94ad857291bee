"""Reports of `iprt scene info` and `iprt scene check`, as lines of text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from iprt.commands.findings import Findings
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.scene.light_report import Share
    from iprt.scene.report import ObjectReport, SceneReport
    from iprt.scene.scene import Scene


def add_first_look(findings: Findings, folder: Path) -> None:
    """Add facts about the first frame of a new scene, for comparison with the real place."""
    from iprt.footage.prepare.remarks import video_remarks
    from iprt.scene.report import surroundings_of, unlikely
    from iprt.scene.scene import Scene

    scene = Scene.open(folder)
    raw = scene.raw_frame()
    place = surroundings_of(scene, raw)
    if place is not None:
        findings.say(f"place: {place.line()}", place=place.line())
    findings.note(video_remarks(scene.raw_frames))
    findings.warn(unlikely(scene, raw, place))


def add_memory(
    findings: Findings, scene: Scene, frame: Frame, device: ComputeDevice | None
) -> None:
    """Add the memory of the largest view, and a warning for each view that does not fit."""
    from iprt.commands.views import choose_view
    from iprt.device.budget import amount
    from iprt.film import film_plan

    plans = {}
    for name in scene.views or (None,):
        view, instances = choose_view(scene, name)
        label = "a view" if name is None else f"view {name}"
        plans[label] = film_plan(scene, frame, instances, view)
    largest = max(plans, key=lambda label: plans[label].bytes)
    view, need = plans[largest].view, plans[largest].bytes
    line = f"memory: {amount(need)} for {largest} of {view.width} x {view.height}"
    if device is not None:
        line += f"; {device.name} has {amount(device.memory)}"
    findings.say(line, memory_mib=need / 2**20)
    if device is None:
        return
    problems = {
        label: plan.problem(device.name, device.memory, device.largest_buffer)
        for label, plan in plans.items()
    }
    findings.warn(f"{label}: {why}" for label, why in problems.items() if why)


def render_plan(scene: Scene, frame: Frame) -> dict[str, dict[str, object]]:
    """Return the passes and the memory of each view of a scene, by name."""
    from iprt.film import film_plan

    plan: dict[str, dict[str, object]] = {}
    for name, entry in scene.views.items():
        built = film_plan(scene, frame, scene.instances_of(name), entry.view)
        memory = built.bytes / 2**20
        plan[name] = {"parts": built.features.describe(), "device_memory_mib": memory}
    return plan


def plan_lines(plan: dict[str, dict[str, object]]) -> list[str]:
    """Return the plan as lines of text."""
    lines = []
    for name, entry in plan.items():
        parts = entry["parts"]
        assert isinstance(parts, dict)
        built = ", ".join(part for part, needed in parts.items() if needed) or "resampling only"
        memory = entry["device_memory_mib"]
        lines.append(f"builds     {name}: {built}; {memory:.0f} MiB on the device")
    return lines


def report_lines(report: SceneReport) -> list[str]:
    """Return a report as lines of text."""
    first, last = report.frames
    depth, radiance = report.depth_percentiles, report.radiance_percentiles
    lines = [
        f"{report.name}",
        f"panorama   {report.width} x {report.height}, frames {first} to {last}, "
        f"{report.fps:g} per second, exposure {report.exposure:g}",
        f"depth      {report.depth_unit}; 1% is below {depth['p1']:.2f} m, half below "
        f"{depth['p50']:.2f} m, 99% below {depth['p99']:.2f} m",
        *([f"place      {report.surroundings.line()}"] if report.surroundings else []),
        *(f"           warning: {phrase}" for phrase in report.unlikely),
        f"radiance   1% is below {radiance['p1']:.3g}, half below {radiance['p50']:.3g}, 99% below "
        f"{radiance['p99']:.3g}; highest {radiance['p100']:.3g}",
        f"normals    {report.normals}",
        _share_line("no depth", report.holes),
        _share_line("  openings", report.openings),
        _share_line("  open sky", report.open_sky),
        _share_line("  dropouts", report.dropouts),
    ]
    if report.clipped is not None:
        lines.append(f"clipped    {report.clipped.line()}")
    lines += [f"{label:<10} {words}" for label, words in report.lines()]
    lines += [line for entry in report.objects for line in _object_lines(entry)]
    for name, view in report.views.items():
        shown = ", ".join(view["objects"]) or "no objects"
        lines.append(
            f"view       {name}: {view['width']} x {view['height']}, yaw {view['yaw_deg']:g}, "
            f"pitch {view['pitch_deg']:g}, fov {view['fov_y_deg']:g}; {shown}"
            + ("; has a truth" if view["truth"] else "")
        )
        lines += [f"           moves: {view['moves']}"] if view["moves"] else []
    return lines


def _share_line(label: str, share: Share) -> str:
    return f"{label:<10} {share.line()}"


def _object_lines(entry: ObjectReport) -> list[str]:
    size = [high - low for low, high in zip(entry.low, entry.high, strict=True)]
    corner = ", ".join(f"{value:.2f}" for value in entry.low)
    content = f"{entry.triangles} triangles, {', '.join(entry.materials)}"
    if entry.light is not None:
        content = f"light, {entry.light}"
    lines = [
        f"object     {entry.name}: {content}; "
        f"{size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} m from ({corner})"
    ]
    lines += [f"           moves: {phrase}" for phrase in entry.moves]
    lines += [f"           not read: {phrase}" for phrase in entry.dropped]
    lines += [f"           warning: {phrase}" for phrase in entry.warnings]
    return lines
