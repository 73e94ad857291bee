"""`iprt scene`: look at a scene, check it, make one from pictures, and put objects into it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from iprt.commands.pairs import DepthRange, Values
from iprt.commands.streams import reporting
from iprt.errors import IprtError
from iprt.files.wording import counted

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
        Follow links in the scene's folder to files outside of it.

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
    device: str | None = None,
    allow_outside: bool = False,
) -> int:
    """Read every file of a scene; name all problems, what is not read, and badly placed objects.

    It also says whether the views fit into a device's memory, at the default settings.

    Parameters
    ----------
    scene
        Scene folder.
    device
        gpu, cpu, a place such as 0:0 (see `iprt doctor`), or part of a device's name. Default: the
        fastest kind there is.
    allow_outside
        Follow links in the scene's folder to files outside of it.

    Returns
    -------
    int
        Exit status 0; problems end with status 2.
    """
    import numpy as np

    from iprt.commands.scene_report import memory_lines
    from iprt.footage.prepare.remarks import video_remarks
    from iprt.scene.report import check_files, describe_scene
    from iprt.scene.scene import Scene

    compute = _device(device)
    opened = Scene.open(scene, allow_outside=allow_outside)
    made_up = check_files(opened)
    raw = opened.raw_frame()
    frame = opened.preparation()(raw)
    report = describe_scene(opened, frame, raw)
    made_up += report.unlikely
    for line in made_up:
        print(f"warning: {line}")
    for line in video_remarks(opened.raw_frames):
        print(f"note: {line}")
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
        f"{report.name}: {verdict}; {counted(last - first + 1, 'frame')}, "
        f"{counted(len(report.objects), 'object')}, {counted(len(report.views), 'view')}"
    )
    return 0


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
) -> int:
    """Make a scene folder from a panorama and its depth, or from a video with depth.

    Parameters
    ----------
    folder
        Folder to make.
    color
        360° picture: EXR, PNG, JPEG, WebP, AVIF, TIFF or HDR, twice as wide as high; for video a
        pattern such as color.%04d.png, or a video file.
    depth
        Its depth: EXR, PFM, NumPy, or grey PNG or TIFF of the same size or smaller, or a video
        file of 16-bit grey. Default: in the same file as colour: a layer of EXR, a second stream,
        or below colour in each picture.
    depth_scale
        Metres per stored unit; 0.001 for millimetres. PNG and video need it or depth_range.
    depth_range
        Metres that the lowest and the highest stored value stand for.
    depth_encoding
        What grows in proportion with the stored values of --depth-range: depth (linear) or its
        inverse. Default: linear.
    depth_kind
        What depth measures: the distance along each ray, or the z-depth of a cube's six faces
        (cube). The z-depth of one axis (z) is refused, for it tells nothing of what is beside.
    invalid
        Stored values that mean that nothing was measured: holes, filled in from around.
    sky
        Stored values that mean that there is no surface. Default, without --invalid: what stands
        out, such as 65535 and 1e10; with no value, none.
    normal
        World-space normals in an EXR file. Default: the layer of colour's file that is named so and
        agrees with depth; else they are fitted to depth.
    color_layer
        Layer of an EXR file that is the picture. Default: by the layers' names.
    depth_layer
        Layer of an EXR file that is depth. Default: by the layers' names.
    eye
        Half to take of a stereo picture: left is the upper one, or the left of two side by side.
    fit
        How a picture that is not twice as wide as high covers the sphere: stretch takes it for all
        of it, pad takes rows for missing at top and bottom, crop cuts such rows off, as black bars.
    list_layers
        Print the layers of the files and stop; no folder is made.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.scene_report import first_look
    from iprt.footage.video.depth_code import DepthCode, DepthMarks
    from iprt.scene.edit import new_scene
    from iprt.scene.sources import layer_lists

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
            "--depth-kind z: z-depth along one axis tells nothing of what is beside the camera; "
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
    with reporting(f"{folder} has been made all the same"):
        print("\n".join(first_look(folder)))
        print(
            f"{folder}: a scene of {counted(frames, 'frame')}; next: "
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
    unit: str | None = None,
    up: Literal["x", "-x", "y", "-y", "z", "-z"] = "y",
    rotate: float = 0.0,
    animation: str | None = None,
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
        PLY, OBJ, STL, glTF or GLB file.
    look
        YAW,PITCH in degrees, right and up: the direction in which the surface is seen.
    height
        Height of the object in metres. Default, without unit: so that its longest side is a fifth
        of its distance.
    unit
        Unit of the mesh file, in place of height: m, cm, mm, in, ft, or the metres of one unit.
    up
        Axis of the mesh file that points up.
    rotate
        Degrees to turn the object to the left about the vertical: counter-clockwise from above.
    animation
        Name or number of the animation of a glTF file that moves the object.
    material
        diffuse:R,G,B or conductor:R,G,B:ALPHA or plastic:R,G,B:ALPHA or mirror. Default: the mesh
        file's own.
    name
        Name of the object. Default: the mesh file's.
    allow_outside
        Follow links in the scene's folder to files outside of it.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.scene.adding import add_object
    from iprt.scene.edit import parse_material
    from iprt.scene.stance import Stance, parse_unit

    yaw, pitch = _direction(look)
    stance = Stance(up, rotate, height, None if unit is None else parse_unit(unit))
    table = None if material is None else parse_material(material)
    added = add_object(
        scene,
        mesh,
        yaw,
        pitch,
        stance=stance,
        material=table,
        animation=int(animation) if animation is not None and animation.isdecimal() else animation,
        name=name,
        allow_outside=allow_outside,
    )
    x, y, z = added.base
    next_words = ["iprt", "render", str(scene), "--view", added.view, "-o", f"{added.view}.png"]
    with reporting(f"{added.name} has been added to {scene} all the same"):
        for phrase in added.dropped:
            print(f"note: {added.name}: not read from its file: {phrase}")
        for phrase in added.hints:
            print(f"hint: {added.name}: {phrase}")
        for phrase in added.warnings:
            print(f"warning: {added.name}: {phrase}")
        print(f"{added.name}: {added.size}")
        place = f"({x:.2f}, {y:.2f}, {z:.2f})"
        print(f"{added.name}: stands at {place}; next: {shlex.join(next_words)}")
    return 0


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
