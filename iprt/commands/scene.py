"""`iprt scene`: show and check a scene, make one from pictures, and place objects in it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from iprt.commands.flag_types import DepthRange, Direction, Values
from iprt.commands.standard_streams import reporting
from iprt.errors import IprtError
from iprt.files.message_text import counted

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice


def info(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    json: bool = False,
    thumbnail: Path | None = None,
    allow_outside: bool = False,
) -> int:
    """Show the size, depth, light through openings, objects and views of a scene.

    Parameters
    ----------
    scene
        Scene folder.
    json
        Print JSON instead of text.
    thumbnail
        PNG file to write: the panorama with axes, views and objects drawn in.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.scene_report import plan_lines, render_plan, report_lines
    from iprt.files.atomic import require_writable
    from iprt.footage.prepare.remarks import video_notices, video_remarks
    from iprt.output.thumbnail import write_thumbnail
    from iprt.scene.report import describe_scene
    from iprt.scene.scene import Scene

    if thumbnail is not None:
        if thumbnail.suffix.lower() != ".png":
            raise IprtError(f"--thumbnail {thumbnail}: expected a name that ends in .png")
        require_writable(thumbnail)
    opened = Scene.open(scene, allow_outside=allow_outside)
    if thumbnail is not None:
        opened.require_not_ours(thumbnail)
    raw = opened.raw_frame()
    frame = opened.preparation()(raw)
    report = describe_scene(opened, frame, raw)
    if thumbnail is not None:
        write_thumbnail(thumbnail, opened, frame)
    plan = render_plan(opened, frame)
    notices = video_notices(opened.source) + video_remarks(opened.raw_frames)
    if json:
        import json as json_format

        record = {**report.record(), "notices": notices, "renderer": plan}
        print(json_format.dumps(record, indent=2))
    else:
        notes = [f"note       {line}" for line in notices]
        print("\n".join(report_lines(report) + notes + plan_lines(plan)))
    return 0


def check(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    strict: bool = False,
    json: bool = False,
    device: str | None = None,
    allow_outside: bool = False,
) -> int:
    """Read every file of a scene and report problems.

    Warnings are about unlikely depth, badly placed objects, surfaces that nothing matches, and
    views that do not fit into the device's memory at the default settings. Notes name the parts of
    files that are not read.

    Parameters
    ----------
    scene
        Scene folder.
    strict
        Exit with status 1 if there are warnings.
    json
        Print a JSON object instead of text.
    device
        OpenCL device: gpu, cpu, PLATFORM:DEVICE such as 0:0 (`iprt doctor` lists them), or part of
        a name. Default: $IPRT_DEVICE, or else the fastest.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status: 0, or 1 if there are warnings and `strict` is given; files that cannot be used
        end with status 2.
    """
    import numpy as np

    from iprt.commands.findings import Findings
    from iprt.commands.scene_report import add_memory
    from iprt.commands.setting_flags import BALANCED
    from iprt.footage.prepare.remarks import video_remarks
    from iprt.scene.report import check_files, describe_scene
    from iprt.scene.scene import Scene

    compute = _device(device)
    opened = Scene.open(scene, allow_outside=allow_outside)
    BALANCED.resolved(opened)  # raises errors in its settings
    findings = Findings(scene=opened.name)
    findings.warn(check_files(opened))
    raw = opened.raw_frame()
    frame = opened.preparation()(raw)
    report = describe_scene(opened, frame, raw)
    findings.warn(report.unlikely)
    findings.note(video_remarks(opened.raw_frames))
    lost = 1.0 - float(np.isfinite(raw.color).all(axis=-1).mean())
    if lost > 0.0:
        findings.warn([f"color: {lost:.2%} of the picture is NaN or infinite and shown black"])
    for material in report.real_materials:
        findings.warn(f"{material.name}: {phrase}" for phrase in material.warnings())
    if report.clipped is not None:
        findings.note([report.clipped.line()])
    for entry in report.objects:
        findings.note(f"{entry.name}: not read from its file: {phrase}" for phrase in entry.dropped)
        findings.warn(f"{entry.name}: {phrase}" for phrase in entry.warnings)
    add_memory(findings, opened, frame, compute)
    first, last = report.frames
    counts = {
        "frames": last - first + 1,
        "objects": len(report.objects),
        "views": len(report.views),
    }
    verdict = "usable, but see the warnings" if findings.warnings else "fine"
    told = ", ".join(counted(count, name.removesuffix("s")) for name, count in counts.items())
    findings.say(f"{report.name}: {verdict}; {told}", **counts)
    findings.print(as_json=json)
    return int(strict and bool(findings.warnings))


def new(
    folder: tyro.conf.Positional[Path],
    /,
    *,
    color: Path,
    depth: Path | None = None,
    depth_scale: float | None = None,
    depth_range: DepthRange = None,
    depth_encoding: Literal["linear", "inverse"] | None = None,
    depth_kind: Literal["distance", "cube", "z"] = "distance",
    invalid: Values = None,
    sky: Values = None,
    normal: Path | None = None,
    color_layer: str | None = None,
    depth_layer: str | None = None,
    eye: Literal["left", "right"] | None = None,
    fit: Literal["stretch", "pad", "crop"] | None = None,
    list_layers: bool = False,
    json: bool = False,
) -> int:
    """Make a scene folder from a panorama and its depth, or from a video with depth.

    Parameters
    ----------
    folder
        Folder to make.
    color
        Equirectangular 360° picture, twice as wide as high: EXR, PNG, JPEG, WebP, AVIF, TIFF or
        HDR. For video a pattern such as color.%04d.png, or a video file.
    depth
        Its depth: EXR, PFM, NumPy, or grey PNG or TIFF of the same size or smaller, or a video
        file of 16-bit grey. Default: in the same file as color: a layer of EXR, a second stream,
        or below color in each picture.
    depth_scale
        Metres per stored unit: 0.001 for millimetres. PNG and video need it or --depth-range.
    depth_range
        Depths in metres of the lowest and the highest stored value.
    depth_encoding
        Whether the values stored for --depth-range are linear in depth, or in its inverse
        (disparity). Default: linear.
    depth_kind
        What depth measures: the distance along each ray, or the planar depth (z) of each face of a
        cube map. Planar depth along a single axis (z) is refused: it cannot cover the sphere.
    invalid
        Stored values that mark missing depth: holes, which are filled from around them.
    sky
        Stored values that mark the sky. Default, without --invalid: detected, such as 65535 and
        1e10. --sky without a value: there are none.
    normal
        EXR file of world-space normals. Default: the normals in the color's file, if there are any
        and they agree with depth; else they are estimated from depth.
    color_layer
        EXR layer of the picture. Default: found by its name.
    depth_layer
        EXR layer of the depth. Default: found by its name.
    eye
        Half of a stereo picture to use. Left is the upper one, or the left of two side by side.
    fit
        How a picture that is not twice as wide as high is fitted to the sphere: stretch it over all
        of it, pad it at top and bottom, or crop rows off there, such as black bars.
    list_layers
        Print the layers of the files and stop; no folder is made.
    json
        Print the findings as a JSON object instead of text.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.findings import Findings
    from iprt.commands.scene_report import add_first_look
    from iprt.footage.video.depth_code import DepthCode, DepthMarks
    from iprt.scene.new_scene import layer_lists, new_scene

    if depth_scale is not None and not 0.0 < depth_scale < float("inf"):
        raise IprtError(f"--depth-scale {depth_scale:g}: expected a number above 0")
    if depth_range is not None and not (
        all(0.0 < end < float("inf") for end in depth_range) and depth_range[0] != depth_range[1]
    ):
        raise IprtError("--depth-range: expected two numbers above 0 that differ")
    if depth_scale is not None and depth_range is not None:
        raise IprtError("--depth-scale and --depth-range: give one of them")
    if depth_encoding is not None and depth_range is None:
        raise IprtError(f"--depth-encoding {depth_encoding}: needs --depth-range")
    if list_layers:
        named = {"color": color, "depth": depth, "normal": normal}
        sources = {key: path for key, path in named.items() if path is not None}
        print("\n".join(layer_lists(sources)))
        return 0
    if depth_kind == "z":
        raise IprtError(
            "--depth-kind z: z-depth along one axis does not cover directions beside the camera; "
            "export the distance along each ray, or a cube's six faces with --depth-kind cube"
        )
    marks = None
    if invalid is not None or sky is not None:
        marks = DepthMarks(invalid or (), sky or ())
    encoding = depth_encoding or "linear"
    code = DepthCode(depth_scale, depth_range, encoding, depth_kind, marks)
    frames = new_scene(
        folder,
        color,
        depth,
        code,
        normal,
        color_layer=color_layer,
        depth_layer=depth_layer,
        eye=eye,
        fit=fit,
    )
    with reporting(f"{folder} has been made nevertheless"):
        findings = Findings(folder=str(folder), frames=frames)
        add_first_look(findings, folder)
        findings.say(
            f"{folder}: a scene of {counted(frames, 'frame')}; next: "
            f"iprt scene add {shlex.quote(str(folder))} MESH --look 0 -35"
        )
        findings.print(as_json=json)
    return 0


def add(
    scene: tyro.conf.Positional[Path],
    mesh: tyro.conf.Positional[Path],
    /,
    *,
    look: Direction,
    height: float | None = None,
    unit: str | None = None,
    up: Literal["x", "-x", "y", "-y", "z", "-z"] = "y",
    rotate: float = 0.0,
    animation: str | None = None,
    material: str | None = None,
    name: str | None = None,
    json: bool = False,
    allow_outside: bool = False,
) -> int:
    """Place an object on the surface seen in a direction, and add a view of it.

    Parameters
    ----------
    scene
        Scene folder.
    mesh
        PLY, OBJ, STL, glTF, GLB or USD file; or sphere, cube, cylinder or square, 1 m wide.
    look
        Direction in which the surface is seen: degrees to the right, and degrees up.
    height
        Height of the object in metres. Default, without --unit: its longest side becomes a fifth of
        its distance.
    unit
        Unit of the mesh file, in place of --height: m, cm, mm, in, ft, or the metres of one unit.
    up
        Axis of the mesh file that points up.
    rotate
        Rotation about the vertical in degrees, counter-clockwise seen from above.
    animation
        Name or number of the glTF animation to play.
    material
        diffuse:R,G,B, conductor:R,G,B:ALPHA, plastic:R,G,B:ALPHA (ALPHA: roughness), mirror,
        glass or pane (a thin wall) or glass:R,G,B:ALPHA (share of light that its surface lets
        through), or lamp:R,G,B, the radiance that it emits. Default: the mesh file's own.
    name
        Name of the object. Default: the mesh file's.
    json
        Print the findings as a JSON object instead of text.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.findings import Findings
    from iprt.scene.mesh_pose import MeshPose, parse_unit
    from iprt.scene.new_object import add_object, parse_material
    from iprt.scene.shapes import mesh_file

    yaw, pitch = look
    if not (abs(yaw) <= 360.0 and abs(pitch) <= 90.0):
        raise IprtError(
            f"--look {yaw:g} {pitch:g}: expected -360 to 360 degrees and -90 to 90 degrees"
        )
    pose = MeshPose(up, rotate, height, None if unit is None else parse_unit(unit))
    table = None if material is None else parse_material(material)
    clip = int(animation) if animation is not None and animation.isdecimal() else animation
    with mesh_file(mesh) as path:
        added = add_object(
            scene,
            path,
            yaw,
            pitch,
            pose=pose,
            material=table,
            animation=clip,
            name=name,
            allow_outside=allow_outside,
        )
    x, y, z = added.base
    next_words = ["iprt", "render", str(scene), "--view", added.view, "-o", f"{added.view}.png"]
    findings = Findings(name=added.name, view=added.view, hints=added.hints)
    findings.note(f"{added.name}: not read from its file: {phrase}" for phrase in added.dropped)
    for phrase in added.hints:
        findings.say(f"hint: {added.name}: {phrase}")
    findings.warn(f"{added.name}: {phrase}" for phrase in added.warnings)
    findings.say(f"{added.name}: {added.size}", size=added.size)
    place = f"({x:.2f}, {y:.2f}, {z:.2f})"
    findings.say(
        f"{added.name}: stands at {place}; next: {shlex.join(next_words)}",
        position=[float(value) for value in added.base],
    )
    with reporting(f"{added.name} has been added to {scene} nevertheless"):
        findings.print(as_json=json)
    return 0


def _device(spec: str | None) -> ComputeDevice | None:
    """Open the requested or the default device.

    None: there is no default device, which is no fault of the scene.
    """
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.errors import DeviceError

    try:
        return ComputeDevice(choose_device(spec))
    except DeviceError:
        if spec is not None:
            raise
        return None
