"""`iprt render` of a video, to a file or to numbered pictures, from the start or continued."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from fractions import Fraction

from iprt.commands.progress import progress_bar
from iprt.commands.render_job import RenderJob
from iprt.device.compute import ComputeDevice
from iprt.files.lock import locked
from iprt.files.message_text import counted
from iprt.files.termination import at_termination
from iprt.film import Film, view_at
from iprt.output.chunks import Chunks, warm_up
from iprt.output.encode import frame_rate
from iprt.output.film_output import FilmOutput
from iprt.output.film_plan import FilmPlan
from iprt.output.frames import Metadata, is_pattern
from iprt.output.sound import Sound
from iprt.output.spatial_media import is_spherical
from iprt.scene.scene_files import fingerprint

LOG = logging.getLogger("iprt.render")

GOES_ON = "the same command continues from there"


def render_video(
    job: RenderJob, plan: FilmPlan, numbers: Sequence[int] | None = None
) -> tuple[ComputeDevice, Film] | None:
    """Render the missing frames of a video.

    Finished frames are kept after an error or a signal, with a note of their number.

    Parameters
    ----------
    numbers : sequence of int or None
        Render these chunks, while other processes may render others, and leave the film unfinished.
        None: render all, and finish it.

    Returns
    -------
    (ComputeDevice, Film), or None
        The device with its profile, and the film; None: no frame was missing.

    Raises
    ------
    IprtError
    """
    from iprt.device.choose import choose_device
    from iprt.device.recovery import with_second_try

    def attempt() -> tuple[ComputeDevice, Film]:
        compute = ComputeDevice(handle, job.frame_limit)
        _warn_of_another(target, compute.name)
        with job.film(compute) as film:
            _render(film, target, plan.chunks, job)
        return compute, film

    whole, output = numbers is None, job.output
    with locked(output.parent, shared=not whole):
        target = FilmOutput(
            output,
            plan,
            plan.chunks.numbers if numbers is None else numbers,
            expected_metadata(job, plan),
        )
        if whole:
            target.clean()

        def kept() -> str | None:
            if not target.done:
                return None
            return f"{target.done} of {counted(target.total, 'frame')} finished; {GOES_ON}"

        result = None
        try:
            if not target.complete:
                handle = choose_device(job.device)
                if target.done:
                    LOG.info(
                        "%s: continuing after %d of %d frames", output, target.done, target.total
                    )
                with at_termination(kept):
                    result = with_second_try(attempt, lambda: target.done)
            if whole:
                target.finish()
        except Exception as error:
            if note := kept():
                error.add_note(note)
            raise
    return result


def _render(film: Film, target: FilmOutput, chunks: Chunks, job: RenderJob) -> None:
    """Render the missing frames of each chunk, and blend its fades where both sides are there."""
    with progress_bar(
        "rendering", target.total, done=target.done, remaining=True, kind=job.progress
    ) as progress:
        for number in target.numbers:
            if missing := target.missing(number):
                for index, picture in film.frames(
                    chunks.frames_of(number),
                    warm_up=chunks.warm_up,
                    wanted=missing,
                    aovs=job.aovs,
                    progress=lambda _: progress(target.done),
                ):
                    target.write(number, index, picture, film.device.name)
                    progress(target.done)
            target.fade(number)


def _warn_of_another(target: FilmOutput, device: str) -> None:
    """Warn if another device has rendered parts of the film."""
    if (other := target.parts.other_device(device)) is not None:
        LOG.warning(
            "earlier frames are by %s, these by %s: they may differ in their last bits",
            other,
            device,
        )


def film_plan(job: RenderJob) -> FilmPlan:
    """Return the plan of a film of the job.

    Raises
    ------
    IprtError
        The chunk is too short, or no container stores the frame rate.
    """
    output, frames = job.output, job.frames
    scene = job.scene
    chunks = Chunks(scene.frame_indices, frames, job.chunk, warm_up(job.accumulate))
    cut = {"frames": job.chunk, "warm_up": chunks.warm_up, "step": frames.step}
    identity = {
        **job.metadata(scene.frame_indices[0], ""),
        "iprt:files": fingerprint(scene),
        "iprt:chunk": json.dumps(cut),
    }
    del identity["iprt:device"]  # parts may come from several devices
    around = view_at(scene, job.view, frames[0]).projection == "equirect"
    sound = None
    if is_pattern(output):
        identity["iprt:layers"] = json.dumps(sorted(job.aovs))
        rate = Fraction(1)
    else:
        identity["iprt:span"] = f"{frames[0]}:{frames[-1]}:{frames.step}"
        identity["iprt:codec"] = job.codec
        rate = frame_rate(scene.source.fps, frames.step)
        if job.audio and (shown := scene.source.moment(frames[0])) is not None:
            sound = Sound(*shown, len(frames) / rate)
        if around and not is_spherical(output):
            LOG.warning(
                "%s: only .mp4 and .mov can mark this as a panorama for players; it will look flat",
                output,
            )
    spherical = around and is_spherical(output)
    return FilmPlan(identity, chunks, scene.exposure, job.codec, rate, spherical, sound)


def expected_metadata(job: RenderJob, plan: FilmPlan) -> Callable[[int], Metadata] | None:
    """Return a function of the metadata of numbered pictures; None for a video file."""
    if not is_pattern(job.output):
        return None

    def expected(index: int) -> Metadata:
        shown = {"iprt:view": job.metadata(index, "")["iprt:view"], "iprt:frame": str(index)}
        return {**plan.identity, **shown}

    return expected
