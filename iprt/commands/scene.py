"""`iprt scene`: look at a scene, check it, make one from pictures, and put objects into it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.scene.frame import Frame
    from iprt.scene.report import ObjectReport, RealMaterialReport, SceneReport, Share
    from iprt.scene.scene import Scene


def info(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    json: bool = False,
    thumbnail: Path | None = None,
    allow_outside: bool = False,
) -> int:
    """Show what a scene holds: size, depth in metres, light through openings, objects, views.

    Parameters
    ----------
    scene
        Scene folder.
    json
        Print JSON instead of text.
    thumbnail
        PNG to write: the panorama with axes, views and objects drawn in.
    allow_outside
        Read files of the scene that are links to what lies outside its folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.output.atomic import require_writable
    from iprt.scene.report import describe_scene
    from iprt.scene.scene import Scene
    from iprt.scene.thumbnail import write_thumbnail

    if thumbnail is not None:
        if thumbnail.suffix.lower() != ".png":
            raise IprtError(f"--thumbnail {thumbnail}: expected a name that ends in .png")
        require_writable(thumbnail)
    opened = Scene.open(scene, allow_outside=allow_outside)
    if thumbnail is not None:
        opened.require_not_ours(thumbnail)
    raw = opened.raw_frame()
    frame = opened.sanitised(raw)
    report = describe_scene(opened, frame, raw)
    if thumbnail is not None:
        write_thumbnail(thumbnail, opened, frame)
    plan = render_plan(opened, frame)
    notices = opened.source.notices()
    if json:
        import json as json_format

        record = {**report.record(), "notices": notices, "renderer": plan}
        print(json_format.dumps(record, indent=2))
    else:
        told = [f"note       {line}" for line in notices]
        print("\n".join(report_lines(report) + told + plan_lines(plan)))
    return 0


def check(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    device: str | None = None,
    allow_outside: bool = False,
) -> int:
    """Read every file of a scene; name all problems, what is not read, and badly placed objects.

    It also tells whether the views fit into a device's memory, at the default settings.

    Parameters
    ----------
    scene
        Scene folder.
    device
        gpu, cpu, a place such as 0:0 (see `iprt doctor`), or part of a device's name. Default: the
        fastest kind there is.
    allow_outside
        Read files of the scene that are links to what lies outside its folder.

    Returns
    -------
    int
        Exit status 0; problems end with status 2.
    """
    import numpy as np

    from iprt.scene.report import check_files, describe_scene
    from iprt.scene.scene import Scene

    compute = _device(device)
    opened = Scene.open(scene, allow_outside=allow_outside)
    made_up = check_files(opened)
    raw = opened.raw_frame()
    frame = opened.sanitised(raw)
    report = describe_scene(opened, frame, raw)
    for line in made_up:
        print(f"warning: {line}")
    lost = 1.0 - float(np.isfinite(raw.color).all(axis=-1).mean())
    if lost > 0.0:
        print(f"warning: colour: {lost:.2%} of the picture is NaN or infinite and shown black")
    empty = [
        f"warning: {entry.name}: {phrase}"
        for entry in report.real_materials
        for phrase in entry.warnings()
    ]
    if empty:
        print("\n".join(empty))
    if report.clipped is not None:
        print(f"note: {report.clipped.line()}")
    for entry in report.objects:
        for phrase in entry.dropped:
            print(f"note: {entry.name}: not read from its file: {phrase}")
        for phrase in entry.warnings:
            print(f"warning: {entry.name}: {phrase}")
    too_large, memory = memory_lines(opened, frame, compute)
    print("\n".join(memory))
    first, last = report.frames
    warned = (
        bool(made_up or empty)
        or lost > 0.0
        or too_large
        or any(entry.warnings for entry in report.objects)
    )
    verdict = "usable, but see the warnings" if warned else "fine"
    print(
        f"{report.name}: {verdict}; {last - first + 1} frame(s), {len(report.objects)} object(s), "
        f"{len(report.views)} view(s)"
    )
    return 0


def new(
    folder: tyro.conf.Positional[Path],
    /,
    *,
    color: Path,
    depth: Path | None = None,
    depth_scale: float | None = None,
    depth_range: tuple[float, float] | None = None,
    depth_encoding: Literal["linear", "inverse"] = "linear",
    normal: Path | None = None,
) -> int:
    """Make a scene folder from a panorama and its depth, or from a video with depth.

    Parameters
    ----------
    folder
        Folder to make.
    color
        360° picture: EXR, PNG or JPEG, twice as wide as high; for video a pattern such as
        color.%04d.png, or a video file.
    depth
        Its depth: EXR, PFM or 16-bit PNG of the same size, or a video file of 16-bit grey. Default:
        in the same file as colour: a second stream, or below colour in each picture.
    depth_scale
        Metres per stored unit; 0.001 for millimetres. PNG and video need it or depth_range.
    depth_range
        Metres that the lowest and the highest value stand for.
    depth_encoding
        Between them, what grows in proportion with the value: depth, or its inverse.
    normal
        World-space normals in an EXR file. Default: fitted to the depth.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.scene.edit import new_scene
    from iprt.scene.video.depth_code import DepthCode

    if depth_scale is not None and not 0.0 < depth_scale < float("inf"):
        raise IprtError(f"--depth-scale {depth_scale:g}: expected a number above 0")
    if depth_range is not None and not (
        all(0.0 < end < float("inf") for end in depth_range) and depth_range[0] != depth_range[1]
    ):
        raise IprtError("--depth-range: expected two numbers above 0 that differ")
    code = DepthCode(depth_scale, depth_range, depth_encoding)
    frames = new_scene(folder, color, depth, code, normal)
    print(
        f"{folder}: a scene of {frames} frame(s); next: "
        f"iprt scene add {shlex.quote(str(folder))} MESH --look 0,-35"
    )
    return 0


def add(
    scene: tyro.conf.Positional[Path],
    mesh: tyro.conf.Positional[Path],
    /,
    *,
    look: str,
    height: float | None = None,
    material: str | None = None,
    name: str | None = None,
    allow_outside: bool = False,
) -> int:
    """Set an object down on the surface seen in a direction, and add a view of it.

    Parameters
    ----------
    scene
        Scene folder.
    mesh
        PLY, OBJ, glTF or GLB file, +Y up.
    look
        YAW,PITCH in degrees, right and up: the direction in which the surface is seen.
    height
        Height of the object in metres. Default: so that its longest side is a fifth of its
        distance.
    material
        diffuse:R,G,B or conductor:R,G,B:ALPHA or plastic:R,G,B:ALPHA or mirror. Default: the mesh
        file's own.
    name
        Name of the object. Default: the mesh file's.
    allow_outside
        Read files of the scene that are links to what lies outside its folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.scene.edit import add_object, parse_material

    yaw, pitch = _direction(look)
    if height is not None and not 0.0 < height < float("inf"):
        raise IprtError(f"--height {height:g}: expected metres above 0")
    table = None if material is None else parse_material(material)
    added = add_object(
        scene,
        mesh,
        yaw,
        pitch,
        height=height,
        material=table,
        name=name,
        allow_outside=allow_outside,
    )
    x, y, z = added.base
    for phrase in added.dropped:
        print(f"note: {added.name}: not read from its file: {phrase}")
    next_words = ["iprt", "render", str(scene), "--view", added.view, "-o", f"{added.view}.png"]
    print(f"{added.name}: stands at ({x:.2f}, {y:.2f}, {z:.2f}); next: {shlex.join(next_words)}")
    return 0


def memory_lines(
    scene: Scene, frame: Frame, device: ComputeDevice | None
) -> tuple[bool, list[str]]:
    """Whether a view needs more memory than the device has, and what to say about it."""
    from iprt.commands.views import choose_view
    from iprt.film import film_plan
    from iprt.memory import amount

    plans = {}
    for name in scene.views or (None,):
        view, objects = choose_view(scene, name)
        instances = scene.instances if objects is None else scene.instances_named(objects)
        label = "a view" if name is None else f"view {name}"
        plans[label] = film_plan(scene, frame, instances, view)
    largest = max(plans, key=lambda label: plans[label].bytes)
    view, need = plans[largest].view, plans[largest].bytes
    line = f"memory: {amount(need)} for {largest} of {view.width} x {view.height}"
    if device is None:
        return False, [line]
    line += f"; {device.name} has {amount(device.memory)}"
    problems = {
        label: plan.problem(device.name, device.memory, device.largest_buffer)
        for label, plan in plans.items()
    }
    warnings = [f"warning: {label}: {why}" for label, why in problems.items() if why]
    return bool(warnings), [line, *warnings]


def _device(spec: str | None) -> ComputeDevice | None:
    """The device asked for; that there is none where none is asked for is no fault of a scene."""
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.errors import DeviceError

    try:
        return ComputeDevice(choose_device(spec))
    except DeviceError:
        if spec is not None:
            raise
        return None


def render_plan(scene: Scene, frame: Frame) -> dict[str, dict[str, object]]:
    """What the renderer builds for each view of a scene and the memory that takes, by name."""
    from iprt.film import film_plan

    plan: dict[str, dict[str, object]] = {}
    for name, entry in scene.views.items():
        built = film_plan(scene, frame, scene.instances_of(name), entry.view)
        memory = built.bytes / 2**20
        plan[name] = {"parts": built.requirements.describe(), "device_memory_mib": memory}
    return plan


def plan_lines(plan: dict[str, dict[str, object]]) -> list[str]:
    """The plan as text."""
    lines = []
    for name, entry in plan.items():
        parts = entry["parts"]
        assert isinstance(parts, dict)
        built = ", ".join(part for part, needed in parts.items() if needed) or "resampling only"
        memory = entry["device_memory_mib"]
        lines.append(f"builds     {name}: {built}; {memory:.0f} MiB on the device")
    return lines


def report_lines(report: SceneReport) -> list[str]:
    """A report as text."""
    first, last = report.frames
    depth, radiance = report.depth_percentiles, report.radiance_percentiles
    lines = [
        f"{report.name}",
        f"panorama   {report.width} x {report.height}, frames {first} to {last}, "
        f"{report.fps:g} per second, exposure {report.exposure:g}",
        f"depth      {report.metres_per_unit:g} m per stored unit; p1 {depth['p1']:.2f} m, "
        f"p50 {depth['p50']:.2f} m, p99 {depth['p99']:.2f} m",
        f"radiance   p1 {radiance['p1']:.3g}, p50 {radiance['p50']:.3g}, "
        f"p99 {radiance['p99']:.3g}, highest {radiance['p100']:.3g}",
        f"normals    {report.normals}",
        _share_line("no depth", report.holes),
        _share_line("  openings", report.openings),
        _share_line("  open sky", report.open_sky),
        _share_line("  dropouts", report.dropouts),
    ]
    if report.clipped is not None:
        lines.append(f"clipped    {report.clipped.line()}")
    lines += [_real_material_line(entry) for entry in report.real_materials]
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


def _real_material_line(entry: RealMaterialReport) -> str:
    """`entry` as text."""
    warned = "".join(f"; warning: {phrase}" for phrase in entry.warnings())
    return (
        f"glossy     {entry.name}: {entry.kind}, alpha {entry.alpha:g}; "
        f"{100 * entry.share.area:.2f}% of all directions, {100 * entry.share.flux:.1f}% of flux"
        f"{warned}"
    )


def _share_line(label: str, share: Share) -> str:
    return f"{label:<10} {100 * share.area:.2f}% of all directions, {100 * share.flux:.1f}% of flux"


def _object_lines(entry: ObjectReport) -> list[str]:
    size = [high - low for low, high in zip(entry.low, entry.high, strict=True)]
    corner = ", ".join(f"{value:.2f}" for value in entry.low)
    lines = [
        f"object     {entry.name}: {entry.triangles} triangles, {', '.join(entry.materials)}; "
        f"{size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} m from ({corner})"
    ]
    lines += [f"           moves: {phrase}" for phrase in entry.moves]
    lines += [f"           not read: {phrase}" for phrase in entry.dropped]
    lines += [f"           warning: {phrase}" for phrase in entry.warnings]
    return lines


def _direction(text: str) -> tuple[float, float]:
    try:
        yaw, pitch = (float(value) for value in text.split(","))
        if not (abs(yaw) <= 360.0 and abs(pitch) <= 90.0):
            raise ValueError
    except ValueError:
        raise IprtError(
            f"--look {text}: expected YAW,PITCH in degrees, such as 30,-40 (pitch from -90 to 90)"
        ) from None
    return yaw, pitch
