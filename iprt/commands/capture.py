"""`iprt capture`: a hand-held RGB-D sequence to a 360° scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro

from iprt.commands.flag_types import Position, Size
from iprt.commands.standard_streams import reporting
from iprt.errors import IprtError
from iprt.files.message_text import counted

WIDTH = 1024
FARTHEST_M = 1e5
Poses = Literal["opencv", "opengl", "opencv-from-world", "opengl-from-world"] | None


def capture(
    sequence: tyro.conf.Positional[Path],
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=("-o",))],
    center: Position = None,
    size: Size = None,
    every: int = 1,
    compensate: bool = True,
    poses: Poses = None,
    json: bool = False,
) -> int:
    """Make a 360° scene from a hand-held RGB-D sequence with poses.

    Parameters
    ----------
    sequence
        Folder of pictures, depth and poses in the format of TUM RGB-D, 7-Scenes, ScanNet, Open3D,
        Redwood or nerfstudio, or in one that its camera.toml describes (docs/capture.md).
    output
        Scene folder to make.
    center
        Centre of the panorama in the world of the poses, in metres.
        Default: the mean position of the camera.
    size
        Width and height of the panorama, twice as wide as high. Default: 1024 512.
    every
        Use every n-th frame.
    compensate
        Do not match exposure and white balance between frames, nor correct vignetting. By default,
        all frames are matched to the first one.
    poses
        Camera convention of the poses: opencv (x right, y down, z forward) or opengl (x right, y
        up, z backward), camera to world or, with -from-world, world to camera. Default: the
        data set's convention, or the one that agrees with depth.
    json
        Print the findings as a JSON object instead of text.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.capture.panorama import capture_panorama, write_scene
    from iprt.capture.rgbd_sequence import RgbdSequence
    from iprt.commands.findings import Findings
    from iprt.commands.progress import progress_bar
    from iprt.commands.scene_report import add_first_look
    from iprt.files.atomic import require_writable
    from iprt.files.safe_reading import MAX_SIDE
    from iprt.scene.manifest import MANIFEST_NAME

    width, height = size or (WIDTH, WIDTH // 2)
    if width != 2 * height or not 16 <= width <= MAX_SIDE:
        raise IprtError(
            f"--size {width} {height}: expected twice as wide as high, 16 8 to "
            f"{MAX_SIDE} {MAX_SIDE // 2}"
        )
    if every < 1:
        raise IprtError(f"--every {every}: expected 1 or more")
    if center is not None and not all(abs(value) <= FARTHEST_M for value in center):
        raise IprtError(f"--center {_spaced(center)}: expected at most {FARTHEST_M:g} m from 0")
    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise IprtError(f"{output}: is there already; choose another folder")
    require_writable(output / MANIFEST_NAME)
    opened = RgbdSequence.open(sequence, poses)
    frames = len(range(0, len(opened.shots), every))
    with progress_bar("capture", frames * (1 + compensate), remaining=True) as update:
        captured = capture_panorama(
            opened,
            width=width,
            center=None if center is None else opened.world_from_poses @ center,
            every=every,
            compensate=compensate,
            progress=update,
        )
    write_scene(output, captured)
    with reporting(f"{output} has been made nevertheless"):
        findings = Findings(folder=str(output), frames=frames)
        findings.say(f"read as {opened.found}", layout=opened.found)
        words = opened.settled.words
        findings.say(f"poses: {words}; up: {opened.up}", poses=words, up=str(opened.up))
        add_first_look(findings, output)
        middle = [float(value) for value in opened.world_from_poses.T @ captured.center]
        x, y, z = middle
        findings.say(
            f"cloud: {counted(captured.samples, 'sample')} held, {captured.removed} removed as "
            f"seen through; centre {x:.3f} {y:.3f} {z:.3f}",
            samples=captured.samples,
            removed=captured.removed,
            center=middle,
        )
        if captured.left_out:
            findings.warn(
                [
                    f"{counted(captured.left_out, 'frame')} of {frames} left out: colors do not "
                    "match the other frames'; --no-compensate uses them"
                ]
            )
        if not captured.matched:
            findings.warn(
                [
                    "colors of most frames do not match at any exposure; all frames are used as "
                    "they are"
                ]
            )
        findings.say(
            f"{output}: {captured.seen_share:.1%} of the sphere seen by {counted(frames, 'frame')}",
            seen_share=float(captured.seen_share),
        )
        findings.print(as_json=json)
    return 0


def _spaced(values: Sequence[float]) -> str:
    return " ".join(f"{value:g}" for value in values)
