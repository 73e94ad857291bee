"""`iprt render` of a video, to a file or to numbered pictures, from the start or continued."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

from iprt.commands.progress import progress_bar
from iprt.commands.render_job import RenderJob
from iprt.device.compute import ComputeDevice
from iprt.files.lock import locked
from iprt.files.message_text import counted
from iprt.files.termination import at_termination
from iprt.film import Film, view_at
from iprt.output.encode import CodecName, frame_rate
from iprt.output.frames import FrameOutput, PictureSequence, is_pattern
from iprt.output.movie import Movie
from iprt.output.sound import Sound
from iprt.output.spatial_media import equirect_boxes, is_spherical
from iprt.scene.scene_files import fingerprint

LOG = logging.getLogger("iprt.render")

WARM_UP, WARM_UP_STEPS = 8, 16
"""Least numbers of video frames and of view frames rendered before the first frame of a run, as its
history. After these, the frame differs from one of an uninterrupted run by noise alone."""
GOES_ON = "the same command continues from there"


def render_video(
    job: RenderJob, output: Path, frames: range, codec: CodecName, *, audio: bool
) -> tuple[ComputeDevice, Film] | None:
    """Render the missing frames of a video.

    With `audio`, a video file keeps the sound of the source video. Finished frames are kept after
    an error or a signal, with a note of their number.

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
        with job.film(compute) as film:
            _render(film, target, frames, job)
        return compute, film

    with locked(output.parent):
        target = _opened(job, output, frames, codec, audio)

        def kept() -> str | None:
            if not target.done:
                return None
            return f"{target.done} of {counted(len(frames), 'frame')} finished; {GOES_ON}"

        try:
            if not target.missing():
                target.finish()
                return None
            handle = choose_device(job.device)
            if target.done:
                LOG.info("%s: continuing after %d of %d frames", output, target.done, len(frames))
            with at_termination(kept):
                result = with_second_try(attempt, lambda: target.done)
            target.finish()
        except Exception as error:
            if note := kept():
                error.add_note(note)
            raise
    return result


def warm_up(accumulate: int) -> int:
    """Return the video frames to render before a run, with `accumulate` view frames each."""
    return max(WARM_UP, -(-WARM_UP_STEPS // accumulate))


def _render(film: Film, target: FrameOutput, frames: range, job: RenderJob) -> None:
    with progress_bar(
        "rendering", len(frames), done=target.done, remaining=True, kind=job.progress
    ) as progress:
        for run in runs(target.missing(), frames):
            for index, picture in film.frames(
                run,
                warm_up=warm_up(job.accumulate),
                aovs=job.aovs,
                progress=lambda _: progress(target.done),
            ):
                target.write(index, picture, film.device.name)
                progress(target.done)


def runs(missing: Sequence[int], frames: range) -> Iterator[range]:
    """Yield the runs of consecutive missing frames in `frames`, in order."""
    positions = [frames.index(index) for index in missing]
    start = 0
    for place, position in enumerate(positions):
        if place + 1 == len(positions) or positions[place + 1] != position + 1:
            yield frames[positions[start] : position + 1]
            start = place + 1


def _opened(
    job: RenderJob, output: Path, frames: range, codec: CodecName, audio: bool
) -> FrameOutput:
    """Open the output, with the frames that an earlier render of the same job has finished."""
    scene = job.scene
    files = {"iprt:files": fingerprint(scene)}
    if is_pattern(output):
        layers = {"iprt:layers": json.dumps(sorted(job.aovs))}

        def describe(index: int) -> dict[str, str]:
            return {**job.metadata(index, ""), **files, **layers, "iprt:frame": str(index)}

        return PictureSequence(output, frames, describe, scene.exposure)
    around = view_at(scene, job.view, frames[0]).projection == "equirect"
    if around and not is_spherical(output):
        LOG.warning(
            "%s: only .mp4 and .mov can mark this as a panorama for players; it will look flat",
            output,
        )
    description = job.metadata(frames[0], "")
    del description["iprt:device"]  # parts may come from several devices
    span = {"iprt:span": f"{frames[0]}:{frames[-1]}:{frames.step}", "iprt:codec": codec}
    rate = frame_rate(scene.source.fps, frames.step)
    shown = scene.source.moment(frames[0]) if audio else None
    return Movie(
        output,
        frames,
        {**description, **files, **span},
        codec=codec,
        rate=rate,
        exposure=scene.exposure,
        additions=equirect_boxes() if around and is_spherical(output) else None,
        sound=None if shown is None else Sound(*shown, len(frames) / rate),
    )
