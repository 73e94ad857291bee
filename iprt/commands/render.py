"""`iprt render`: a picture or a video of a scene with its virtual objects, to files."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.commands.progress import ProgressKind, progress_bar
from iprt.commands.render_flags import Flags
from iprt.errors import IprtError
from iprt.files.message_text import counted

if TYPE_CHECKING:
    from iprt.commands.render_job import RenderJob
    from iprt.convergence import Goal
    from iprt.device.compute import ComputeDevice
    from iprt.film import Film
    from iprt.renderer import RenderedFrame

LOG = logging.getLogger("iprt.render")
FINISHED = "%s: is finished already; delete it to render it again"


def render(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    flags: Flags,
    chunks: str | None = None,
    cluster: str | None = None,
    profile: Path | None = None,
    progress: ProgressKind = "bar",
) -> int:
    """Render one view of a scene to a picture or a video.

    An EXR file holds linear radiance; PNG and video hold display values. If the render of a
    video is interrupted, the same command continues it: finished frames are kept.

    Parameters
    ----------
    scene
        Scene folder.
    flags
        The picture or film, its settings, and its files.
    chunks
        Render only these chunks of a video, such as 3 or 0-7,12, while other processes or machines
        render others. `iprt join` makes the film of them.
    profile
        JSON file to write the time of every pass to; a table is printed, too.
    progress
        How to tell the progress: by a bar, if stderr is a terminal; by lines on stderr, one for
        each finished frame, for programs that run iprt; or by lines for farms (openjd).

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.standard_streams import reporting

    if chunks is not None:
        flags.require_video("--chunks")
    if cluster is not None:
        flags.require_video("--cluster")
        if profile is not None:
            raise IprtError(f"--profile {profile}: has no effect with --cluster")
    job = flags.job(scene, profile=profile, progress=progress)
    written = job.output
    if flags.video:
        from iprt.commands.render_video import film_plan, render_video
        from iprt.output.chunks import chunk_numbers
        from iprt.output.parts import parts_of

        plan = film_plan(job)
        numbers = None if chunks is None else chunk_numbers(chunks, plan.chunks.numbers)
        written = job.output if numbers is None else parts_of(job.output)
        if cluster is not None:
            from iprt.commands.render_cluster import render_on_cluster

            if not render_on_cluster(job, plan, flags, cluster, numbers):
                LOG.info(FINISHED, written)
            with reporting(f"{written} has been written nevertheless"):
                print(written)
            return 0
        rendered = render_video(job, plan, numbers)
    else:
        rendered = _render_still(job)
    _report(job, written, rendered, profile)
    return 0


def _render_still(job: RenderJob) -> tuple[ComputeDevice, Film]:
    """Render one picture of the first frame; return the device and the film that rendered it.

    If the driver loses the device, the render is repeated once with a new one.
    """
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.device.recovery import with_second_try
    from iprt.files.lock import locked
    from iprt.output.picture import write_picture

    handle, index = choose_device(job.device), job.frames[0]

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

    with locked(job.output.parent):
        picture, compute, film, goal = with_second_try(attempt)
        write_picture(
            job.output,
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
    output: Path,
    rendered: tuple[ComputeDevice, Film] | None,
    profile: Path | None,
) -> None:
    """Print the output's path and, if asked for, the times of the passes of the first frame."""
    from iprt.commands.standard_streams import reporting

    with reporting(f"{output} has been written nevertheless"):
        if rendered is None:
            LOG.info(FINISHED, output)
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
                view=view_at(job.scene, job.view, job.frames[0]),
                settings=job.settings,
                prepare_ms=film.prepare_ms,
            )
            if profile is not None:
                write_report(profile, report)
            print_grid(pass_grid(report))
        print(output)
