"""Flags of `iprt render` that tell what to render, for every verb that renders."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from iprt.commands.flag_types import Size, listed
from iprt.commands.progress import ProgressKind
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.commands.tradeoff_flags import TradeoffGoal
from iprt.errors import IprtError
from iprt.settings.presets import CONVERGED

if TYPE_CHECKING:
    from iprt.commands.render_job import RenderJob

FRAME_LIMIT_S = 600.0
"""Longer than any frame that a processor's two cores can be expected to be given."""


@dataclass(frozen=True, kw_only=True)
class RenderFlags:
    """Flags of a render: the picture or film, its settings, and its files.

    Attributes
    ----------
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
    chunk
        Frames of a chunk of a video. Where a frame is rendered changes nothing: chunks are cut at
        multiples of this number, and each begins with a warm-up of 8 frames or more, over which the
        chunk before fades into it. Default: 120.
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
    allow_outside
        Follow symbolic links that lead out of the scene folder.
    frame_limit
        Seconds without a finished frame after which the device counts as hung.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=("-o",))]
    frames: str | None = None
    view: str | None = None
    yaw: float | None = None
    pitch: float | None = None
    fov: float | None = None
    size: Size = None
    accumulate: int | None = None
    codec: Literal["h264", "hevc"] | None = None
    no_audio: bool = False
    chunk: int | None = None
    seed: int | None = None
    method: str | None = None
    time_per_frame: float | None = None
    ssim: float | None = None
    setting_flags: ChosenSettings = BALANCED
    device: str | None = None
    aov: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    strict: bool = False
    allow_outside: bool = False
    frame_limit: float = FRAME_LIMIT_S

    @property
    def video(self) -> bool:
        """True for several frames: numbered pictures, or a video file."""
        from iprt.output.frames import is_video

        return is_video(self.output)

    def check(self) -> None:
        """Refuse what can be refused before the scene is read.

        Raises
        ------
        IprtError
        """
        from iprt.aovs import AOVS
        from iprt.output.encode import FORMATS
        from iprt.render_check import MAX_FRAMES, check_format

        if self.accumulate is not None and not 1 <= self.accumulate <= MAX_FRAMES:
            raise IprtError(f"--accumulate {self.accumulate}: expected 1 to {MAX_FRAMES}")
        if not 0.0 < self.frame_limit < float("inf"):
            raise IprtError(f"--frame-limit {self.frame_limit:g}: expected seconds above 0")
        codec = self.codec
        film_flag = "--no-audio" if self.no_audio else None if codec is None else f"--codec {codec}"
        if film_flag is not None and self.output.suffix.lower() not in FORMATS:
            kinds = ", ".join(FORMATS)
            raise IprtError(f"{film_flag}: has no effect on {self.output}; it is for {kinds}")
        if self.chunk is not None:
            self.require_video("--chunk")
        layers = listed(self.aov)
        check_format(self.output, self.setting_flags.quality, layers)
        for name in layers:
            if name not in AOVS:
                raise IprtError(f"--aov {name}: no such layer; the layers are: {', '.join(AOVS)}")

    def require_video(self, flag: str) -> None:
        """Refuse a flag that is for videos alone.

        Raises
        ------
        IprtError
            The output is one picture.
        """
        if not self.video:
            raise IprtError(f"{flag}: has no effect on {self.output}; it is for videos")

    def job(
        self, scene: Path, *, profile: Path | None = None, progress: ProgressKind = "bar"
    ) -> RenderJob:
        """Return the job that the flags describe; everything about it is checked.

        Parameters
        ----------
        scene : Path
            Scene folder.
        profile : Path or None
            See `iprt render`.
        progress : {"bar", "lines", "openjd"}
            See `progress_bar`.

        Raises
        ------
        IprtError
        """
        goal = TradeoffGoal.of(self.time_per_frame, self.ssim, self.setting_flags.quality)
        self.check()
        if profile is not None:
            _check_profile(profile, self.output)

        from iprt.commands.frame_range import frame_range
        from iprt.commands.render_job import RenderJob
        from iprt.commands.views import moving_view
        from iprt.geometry.camera import View
        from iprt.output.chunks import LENGTH
        from iprt.render_check import check_frames, default_frames
        from iprt.scene.scene import Scene

        flags, video, output, aovs = self.setting_flags, self.video, self.output, listed(self.aov)
        resolved = partial(flags.resolved, still=not video, seed=self.seed, method=self.method)
        resolved()  # report faults in flags first
        opened = Scene.open(scene, allow_outside=self.allow_outside, strict=self.strict)
        settings = resolved(opened)
        if goal is not None:
            goal.require_method(settings.method)
        frames = frame_range(self.frames, opened.frame_indices)
        if profile is not None:
            opened.require_not_ours(profile)
        view, objects = moving_view(
            opened, self.view, yaw=self.yaw, pitch=self.pitch, fov=self.fov, size=self.size
        )
        frames = frames if video or self.frames is not None else frames[:1]
        codec = self.codec or "h264"
        check_frames(opened, view, output, frames, codec=codec, aovs=aovs)
        accumulate = self.accumulate or default_frames(flags.quality, video=video)
        if goal is not None:
            shown = view if isinstance(view, View) else view.view
            entry = goal.assignments(
                self.device, shown.width * shown.height, accumulate, flags.assignments(opened)
            )
            settings = resolved(opened, under=entry)
        return RenderJob(
            scene=opened,
            output=output,
            frames=frames,
            view=view,
            objects=objects,
            settings=settings,
            accumulate=accumulate,
            converged=CONVERGED.get(flags.quality),
            aovs=aovs,
            codec=codec,
            audio=not self.no_audio,
            chunk=LENGTH if self.chunk is None else self.chunk,
            strict=self.strict,
            device=self.device,
            frame_limit=self.frame_limit,
            profiled=profile is not None,
            progress=progress,
        )


def _check_profile(profile: Path, output: Path) -> None:
    """Check the file for the profile, before the scene is read."""
    from iprt.files.atomic import require_writable

    require_writable(profile)
    if profile.resolve() == output.resolve():
        raise IprtError(f"--profile {profile}: is the picture's name too; name another file")


Flags = Annotated[RenderFlags, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="render")]
"""`RenderFlags` as a parameter of a verb."""
