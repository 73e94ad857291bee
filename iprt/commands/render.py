"""`iprt render`: a picture or a video of a scene with its virtual objects, to files."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from iprt.commands.flag_types import Size, listed
from iprt.commands.progress import ProgressKind, progress_bar
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.commands.tradeoff_flags import TradeoffGoal
from iprt.errors import IprtError
from iprt.files.message_text import counted
from iprt.settings.presets import CONVERGED

if TYPE_CHECKING:
    from iprt.commands.render_job import RenderJob
    from iprt.convergence import Goal
    from iprt.device.compute import ComputeDevice
    from iprt.film import Film
    from iprt.renderer import RenderedFrame

FRAME_LIMIT_S = 600.0
"""Longer than any frame that a processor's two cores can be expected to be given."""

LOG = logging.getLogger("iprt.render")


def render(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=("-o",))],
    frames: str | None = None,
    view: str | None = None,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    size: Size = None,
    accumulate: int | None = None,
    codec: Literal["h264", "hevc"] | None = None,
    no_audio: bool = False,
    seed: int | None = None,
    method: str | None = None,
    time_per_frame: float | None = None,
    ssim: float | None = None,
    setting_flags: ChosenSettings = BALANCED,
    device: str | None = None,
    aov: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    strict: bool = False,
    profile: Path | None = None,
    allow_outside: bool = False,
    frame_limit: float = FRAME_LIMIT_S,
    progress: ProgressKind = "bar",
) -> int:
    """Render one view of a scene to a picture or a video.

    An EXR file holds linear radiance; PNG and video hold display values. If the render of a
    video is interrupted, the same command continues it: finished frames are kept.

    Parameters
    ----------
    scene
        Scene folder.
    output
        File to write; its suffix chooses the format: .exr or .png for a picture, .mp4, .mov or .mkv
        for a video. A name such as frame.%04d.png writes numbered pictures of a video.
    frames
        Which frames of the video to render: one number, such as 24; FIRST:LAST, such as 24:71, with
        both ends; or FIRST:LAST:STEP, such as 0:100:10. FIRST and LAST may be left out: ::10 is
        every tenth frame. Numbers are as in scene.toml. Default: all frames for a video, the
        first one for a picture.
    view
        Name of a view of the scene, or `equirect` for the whole panorama; players let one look
        around in .mp4 and .mov files of it. Default: the scene's first view.
    yaw
        Viewing direction in degrees to the right, for a picture of all objects. Not with --view.
    pitch
        Viewing direction in degrees up. Not with --view.
    fov
        Vertical field of view in degrees, above 1 and below 179. Not with --view. Default: 60.
    size
        Width and height in pixels. Default: the view's own.
    accumulate
        Frames accumulated into a picture, or into each frame of a video. Default: 64 for a picture;
        4 for a frame of a video, which builds on the frames before it. With --quality final this
        is the upper limit, 2048 by default.
    codec
        How .mp4, .mov and .mkv are coded: h264 (8 bits) plays everywhere; hevc (10 bits) shows no
        bands in soft gradients. Default: h264.
    no_audio
        Leave out the sound of the scene's video file, which .mp4, .mov and .mkv keep.
    seed
        Seed of the random numbers; the same seed gives the same picture on the same device.
        Short for --set seed=.
    method
        Relighting method: a name from `iprt methods`. Short for --set method=.
    time_per_frame
        Seconds that each accumulated frame may take: chooses the most accurate settings that are
        estimated to keep the limit (`iprt calibrate`), in place of a quality preset.
    ssim
        Mean SSIM to reach after --accumulate frames: chooses the fastest settings that are
        estimated to reach it (`iprt calibrate`). If none is, the most accurate are used, with a
        warning.
    setting_flags
        Later ones win: preset or the choice of --time-per-frame or --ssim, user's file, scene,
        environment, --settings, --set.
    device
        OpenCL device: gpu, cpu, PLATFORM:DEVICE such as 0:0 (`iprt doctor` lists them), or part of
        a name. Default: $IPRT_DEVICE, or else the fastest.
    aov
        Auxiliary layers (AOVs) to add to EXR files, separated by commas or with --aov again, such
        as normal,depth.
    strict
        Stop at the first frame of the video that cannot be read, instead of repeating the last good
        frame.
    profile
        JSON file to write the time of every pass to; a table is printed, too.
    frame_limit
        Seconds without a finished frame after which the device counts as hung.
    allow_outside
        Follow symbolic links that lead out of the scene folder.
    progress
        How to tell the progress: by a bar, if stderr is a terminal; or by lines on stderr, one for
        each finished frame, for programs that run iprt.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.render_check import MAX_FRAMES, check_format, check_frames, default_frames

    if accumulate is not None and not 1 <= accumulate <= MAX_FRAMES:
        raise IprtError(f"--accumulate {accumulate}: expected 1 to {MAX_FRAMES}")
    if not 0.0 < frame_limit < float("inf"):
        raise IprtError(f"--frame-limit {frame_limit:g}: expected seconds above 0")
    aov = listed(aov)
    tradeoff_goal = TradeoffGoal.of(time_per_frame, ssim, setting_flags.quality)
    from iprt.output.encode import FORMATS
    from iprt.output.frames import is_video

    video = is_video(output)
    film_flag = "--no-audio" if no_audio else None if codec is None else f"--codec {codec}"
    if film_flag is not None and output.suffix.lower() not in FORMATS:
        kinds = ", ".join(FORMATS)
        raise IprtError(f"{film_flag}: has no effect on {output}; it is for {kinds}")
    check_format(output, setting_flags.quality, aov)
    _check_files(output, profile, aov)

    from iprt.commands.frame_range import frame_range
    from iprt.commands.render_job import RenderJob
    from iprt.commands.views import moving_view
    from iprt.geometry.camera import View
    from iprt.scene.scene import Scene

    resolved = partial(setting_flags.resolved, still=not video, seed=seed, method=method)
    resolved()  # report faults in flags first
    opened = Scene.open(scene, allow_outside=allow_outside, strict=strict)
    settings = resolved(opened)
    if tradeoff_goal is not None:
        tradeoff_goal.require_method(settings.method)
    indices = frame_range(frames, opened.frame_indices)
    if profile is not None:
        opened.require_not_ours(profile)
    chosen, objects = moving_view(opened, view, yaw=yaw, pitch=pitch, fov=fov, size=size)
    indices = indices if video or frames is not None else indices[:1]
    check_frames(opened, chosen, output, indices, codec=codec or "h264", aovs=aov)
    accumulate = accumulate or default_frames(setting_flags.quality, video=video)
    if tradeoff_goal is not None:
        shown = chosen if isinstance(chosen, View) else chosen.view
        entry = tradeoff_goal.assignments(
            device, shown.width * shown.height, accumulate, setting_flags.assignments(opened)
        )
        settings = resolved(opened, under=entry)
    job = RenderJob(
        scene=opened,
        view=chosen,
        objects=objects,
        settings=settings,
        accumulate=accumulate,
        converged=CONVERGED.get(setting_flags.quality),
        aovs=tuple(aov),
        strict=strict,
        device=device,
        frame_limit=frame_limit,
        profiled=profile is not None,
        progress=progress,
    )
    if video:
        from iprt.commands.render_video import render_video

        rendered = render_video(job, output, indices, codec or "h264", audio=not no_audio)
    else:
        rendered = _render_still(job, output, indices[0])
    _report(job, indices[0], output, rendered, profile)
    return 0


def _check_files(output: Path, profile: Path | None, aovs: Sequence[str]) -> None:
    """Check the other outputs, before the scene is read."""
    from iprt.aovs import AOVS
    from iprt.files.atomic import require_writable

    if profile is not None:
        require_writable(profile)
        if profile.resolve() == output.resolve():
            raise IprtError(f"--profile {profile}: is the picture's name too; name another file")
    for name in aovs:
        if name not in AOVS:
            raise IprtError(f"--aov {name}: no such layer; the layers are: {', '.join(AOVS)}")


def _render_still(job: RenderJob, output: Path, index: int) -> tuple[ComputeDevice, Film]:
    """Render one picture of a frame; return the device and the film that rendered it.

    If the driver loses the device, the render is repeated once with a new one.
    """
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.device.recovery import with_second_try
    from iprt.files.lock import locked
    from iprt.output.picture import write_picture

    handle = choose_device(job.device)

    def attempt() -> tuple[RenderedFrame, ComputeDevice, Film, Goal | None]:
        goal = job.goal()
        with progress_bar("rendering", job.accumulate, kind=job.progress) as progress:
            done = 0

            def forward(frames: int) -> None:
                nonlocal done
                done = frames
                noise = None if goal is None else goal.reached
                progress(done, "" if noise is None else f", noise {noise:.2g}")

            progress(done, ": reading the scene")
            compute = ComputeDevice(handle, job.frame_limit)
            compute.building = lambda file: progress(done, f": compiling {file}")
            with job.film(compute) as film:
                ((_, picture),) = film.frames([index], aovs=job.aovs, progress=forward, goal=goal)
        return picture, compute, film, goal

    with locked(output.parent):
        picture, compute, film, goal = with_second_try(attempt)
        write_picture(
            output,
            picture.color,
            aovs=picture.aovs,
            exposure=job.scene.exposure,
            metadata=job.metadata(index, compute.name, goal),
        )
    if goal is not None:
        _tell_noise(goal)
    return compute, film


def _tell_noise(goal: Goal) -> None:
    """Log the remaining noise, as a warning with advice if it is above the goal."""
    reached = "unknown" if goal.reached is None else f"{goal.reached:.2g} of white"
    told = f"noise {reached} after {counted(goal.frames, 'frame')}"
    if goal.met:
        LOG.info("converged to %g: %s", goal.noise, told)
    else:
        LOG.warning("not converged to %g: %s; raise --accumulate", goal.noise, told)


def _report(
    job: RenderJob,
    index: int,
    output: Path,
    rendered: tuple[ComputeDevice, Film] | None,
    profile: Path | None,
) -> None:
    """Print the output's path and, if asked for, the times of the passes of frame `index`."""
    from iprt.commands.standard_streams import reporting

    with reporting(f"{output} has been written nevertheless"):
        if rendered is None:
            LOG.info("%s: is finished already; delete it to render it again", output)
            if profile is not None:
                raise IprtError(f"--profile {profile}: is not written, as nothing was rendered")
        elif profile is not None or LOG.isEnabledFor(logging.DEBUG):
            from iprt.film import view_at
            from iprt.measure.cost_report import CostReport, write_report
            from iprt.measure.cost_tables import pass_grid
            from iprt.output.grid import print_grid

            compute, film = rendered
            report = CostReport.of(
                compute,
                scene=job.scene.name,
                view=view_at(job.scene, job.view, index),
                settings=job.settings,
                prepare_ms=film.prepare_ms,
            )
            if profile is not None:
                write_report(profile, report)
            print_grid(pass_grid(report))
        print(output)
