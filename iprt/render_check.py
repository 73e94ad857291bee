"""Checks of a render to a file, before it begins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from iprt.errors import FormatError, IprtError
from iprt.files.atomic import require_regular, require_writable
from iprt.film import view_at
from iprt.geometry.camera import View
from iprt.output.encode import CodecName, frame_rate, require_codec, require_even
from iprt.output.frames import is_pattern, is_video, numbered
from iprt.output.parts import PLAN, parts_of
from iprt.output.picture import check_output
from iprt.scene.scene import Scene
from iprt.scene.scene_view import SceneView
from iprt.settings.presets import CONVERGED, Quality

MAX_FRAMES = 2**20
STILL_FRAMES, VIDEO_FRAMES = 64, 4
"""View frames per picture, if nothing is said: of a still, and of each frame of a video."""
MOST_STILL_FRAMES = 2048
"""Most view frames of a still that is rendered until it has converged."""


def default_frames(quality: Quality, *, video: bool) -> int:
    """Return the view frames per picture of a quality."""
    if video:
        return VIDEO_FRAMES
    return MOST_STILL_FRAMES if quality in CONVERGED else STILL_FRAMES


def check_format(output: Path, quality: Quality, aovs: Sequence[str] = ()) -> None:
    """Refuse a format that does not fit the quality or the layers, before the scene is read.

    Raises
    ------
    IprtError
    """
    if not is_video(output):
        check_output(output, aovs=aovs)
    elif quality in CONVERGED:
        raise IprtError(
            f"--quality {quality}: is for a picture, which is rendered until it "
            "has converged; for a video take --quality accurate and --accumulate"
        )


def check_frames(
    scene: Scene,
    view: SceneView | View,
    output: Path,
    frames: range,
    *,
    codec: CodecName = "h264",
    aovs: Sequence[str] = (),
) -> None:
    """Refuse outputs that cannot hold these frames, or that cannot be written.

    Raises
    ------
    IprtError
    """
    if is_pattern(output):
        pictures = [numbered(output, index) for index in frames]
        check_output(pictures[0], aovs=aovs)
        for picture in pictures:
            require_regular(picture)
        scene.require_not_ours(*pictures)
        return
    scene.require_not_ours(output)
    if not is_video(output):
        if len(frames) > 1:
            raise IprtError(
                f"{output}: is one picture, but {len(frames)} frames are asked for; write "
                f"{output.stem}.%04d{output.suffix}, or one of .mp4, .mov, .mkv"
            )
        return
    if aovs:
        raise FormatError(f"{output}: video holds no layers; write numbered .exr files for --aov")
    require_writable(output)
    require_writable(parts_of(output) / PLAN)
    shown = view_at(scene, view, frames[0])
    require_even(shown.width, shown.height)
    require_codec(codec)
    frame_rate(scene.source.fps, frames.step)
