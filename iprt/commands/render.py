"""`iprt render`: one picture of a scene with its virtual objects, to a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from iprt.commands.knobs import BALANCED, Knobs
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.renderer import RenderedFrame
    from iprt.scene.camera import View
    from iprt.scene.scene import Scene
    from iprt.settings import Settings

MAX_SIZE = 16384
MAX_FRAMES = 2**20
FRAME_LIMIT_S = 600.0
"""Longer than any frame that a processor's two cores can be expected to be given."""
DEFAULT_SIZE = (1024, 1024)


def render(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=("-o",))],
    view: str | None = None,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    size: tuple[int, int] | None = None,
    accumulate: int = 64,
    seed: int | None = None,
    method: Literal["iprt", "ibl"] | None = None,
    knobs: Knobs = BALANCED,
    device: str | None = None,
    aov: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    profile: Path | None = None,
    allow_outside: bool = False,
    frame_limit: float = FRAME_LIMIT_S,
) -> int:
    """Render one view of a scene to an EXR (linear) or PNG (as displayed) file.

    Parameters
    ----------
    scene
        Scene folder.
    output
        File to write; its suffix chooses the format: .exr or .png.
    view
        Name of a view of the scene, or `equirect` for the whole panorama. Default: the scene's
        first view.
    yaw
        Degrees to the right, for a view of your own with all objects.
    pitch
        Degrees up.
    fov
        Vertical field of view in degrees, above 1 and below 179.
    size
        Width and height in pixels. Default: the view's own.
    accumulate
        Frames accumulated into the picture.
    seed
        Seed of the random numbers; the same seed gives the same picture on the same device.
        Short for --set seed=.
    method
        How virtual objects are lit; `ibl` is the baseline: a distant environment without real
        geometry. Short for --set method=.
    knobs
        Quality preset and single knobs. Later ones win: preset, file, flags.
    device
        gpu, cpu, a place such as 0:0 (see `iprt doctor`), or part of a device's name. Default: the
        fastest kind there is.
    aov
        Auxiliary layer to add to an EXR file, for example normal or depth; may be given several
        times.
    profile
        JSON file for the times per pass.
    frame_limit
        Seconds after which a device that has not finished a frame is taken to hang.
    allow_outside
        Read files of the scene that are links to what lies outside its folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.output.atomic import require_writable
    from iprt.output.picture import check_output

    if not 1 <= accumulate <= MAX_FRAMES:
        raise IprtError(f"--accumulate {accumulate}: expected 1 to {MAX_FRAMES}")
    if not 0.0 < frame_limit < float("inf"):
        raise IprtError(f"--frame-limit {frame_limit:g}: expected seconds above 0")
    check_output(output, aovs=aov)
    if profile is not None:
        require_writable(profile)
        if profile.resolve() == output.resolve():
            raise IprtError(f"--profile {profile}: is the picture's name too; name another file")

    from rich.console import Console

    from iprt.aovs import AOVS
    from iprt.output.lock import locked
    from iprt.output.metadata import picture_metadata
    from iprt.output.picture import write_picture
    from iprt.output.table import pass_table, write_profile
    from iprt.scene.scene import Scene

    settings = knobs.resolved(still=True, seed=seed, method=method)
    for name in aov:
        if name not in AOVS:
            raise IprtError(f"--aov {name}: no such layer; the layers are: {', '.join(AOVS)}")
    opened = Scene.open(scene, allow_outside=allow_outside)
    for path in (output, profile):
        if path is not None:
            opened.require_not_ours(path)
    chosen, objects = choose_view(opened, view, yaw=yaw, pitch=pitch, fov=fov, size=size)
    with locked(Path(os.path.realpath(output)).parent):
        picture, compute, prepare_ms = _rendered(
            opened, chosen, objects, settings, accumulate, aov, device, frame_limit
        )
        write_picture(
            output,
            picture.color,
            aovs=picture.aovs,
            exposure=opened.exposure,
            metadata=picture_metadata(
                scene=opened.name,
                view=chosen,
                objects=objects,
                settings=settings.model_dump(mode="json"),
                seed=settings.seed,
                frames=accumulate,
                device=compute.name,
            ),
        )
        if profile is not None:
            write_profile(profile, compute.profile, compute.name, prepare_ms=prepare_ms)
    console = Console()
    console.print(pass_table(compute.profile, compute.name, prepare_ms=prepare_ms))
    console.print(str(output), highlight=False, soft_wrap=True)
    return 0


def _rendered(
    scene: Scene,
    view: View,
    objects: tuple[str, ...] | None,
    settings: Settings,
    frames: int,
    aovs: Sequence[str],
    device: str | None,
    frame_limit: float,
) -> tuple[RenderedFrame, ComputeDevice, float]:
    """The picture, the device with its times, and the milliseconds spent once per video frame.

    Where the driver loses the device, all is made anew, once.
    """
    from iprt.commands.progress import progress_bar
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.device.recovery import with_second_try
    from iprt.memory import require_memory
    from iprt.renderer import Renderer

    instances = scene.instances if objects is None else scene.instances_named(objects)
    frame = scene.frame()
    handle = choose_device(device)

    def attempt() -> tuple[RenderedFrame, ComputeDevice, float]:
        compute = ComputeDevice(handle, frame_limit)
        require_memory(compute, frame, instances, view, settings)
        with (
            progress_bar("rendering", frames) as progress,
            Renderer(compute, frame, instances, view, settings) as renderer,
        ):
            compute.finish()
            prepare_ms = sum(entry.ms for entry in compute.profile.passes())
            compute.profile.reset()
            picture = renderer.render(frames=frames, aovs=aovs, progress=progress)
        return picture, compute, prepare_ms

    return with_second_try(attempt)


def choose_view(
    scene: Scene,
    name: str | None,
    *,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    size: tuple[int, int] | None = None,
) -> tuple[View, tuple[str, ...] | None]:
    """The view that the command line asks for, and its objects (None: all of the scene).

    Raises
    ------
    IprtError
        Unknown view, contradicting flags, or a value out of range.
    """
    from iprt.scene.camera import View

    own = yaw is not None or pitch is not None or fov is not None
    if own and name is not None:
        raise IprtError("--view names a direction already; leave out --yaw, --pitch and --fov")
    if size is not None and not all(0 < side <= MAX_SIZE for side in size):
        raise IprtError(f"--size {size[0]} {size[1]}: expected 1 to {MAX_SIZE} pixels a side")
    if fov is not None and not 1.0 < fov < 179.0:
        raise IprtError(f"--fov {fov:g}: expected more than 1 and less than 179 degrees")
    # Written so that NaN, which compares false, is rejected too.
    if yaw is not None and not abs(yaw) <= 360.0:
        raise IprtError(f"--yaw {yaw:g}: expected -360 to 360 degrees")
    if pitch is not None and not abs(pitch) <= 90.0:
        raise IprtError(f"--pitch {pitch:g}: expected -90 to 90 degrees")
    if name == "equirect":
        width, height = size or (scene.width, scene.height)
        return View(width, height, projection="equirect"), None
    if name is None and not own and scene.views:
        name = next(iter(scene.views))
    if name is None:
        width, height = size or DEFAULT_SIZE
        return View(width, height, yaw or 0.0, pitch or 0.0, 60.0 if fov is None else fov), None
    if name not in scene.views:
        known = ", ".join([*scene.views, "equirect"])
        raise IprtError(f"--view {name}: {scene.name} has no such view; the views are: {known}")
    entry = scene.views[name]
    return (entry.view if size is None else entry.view.resized(*size)), entry.objects
