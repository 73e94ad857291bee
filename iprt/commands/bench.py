"""`iprt bench`: how long a frame takes, and what accuracy the time buys."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import tyro

from iprt.commands.flag_types import Size
from iprt.commands.lists import listed
from iprt.commands.setting_flags import BALANCED, ChosenSettings, SettingFlags
from iprt.errors import IprtError

CONVERGED = 256
"""Frames of the last picture with --seconds, where nothing is said."""
TRUTH_FLAGS = "--sweep, --convergence, --seconds, --claims or --against"
MAX_FRAMES = 100_000
MAX_SEEDS = 100
FRAMES, SEEDS, LEVELS, COUNTS = 30, 3, "0.9,0.93,0.95", "1,2,...,64"
"""Defaults of --frames, --seeds, --reach, and with --against of --convergence."""


def bench(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    size: Size = None,
    frames: int | None = None,
    method: str | None = None,
    setting_flags: ChosenSettings = BALANCED,
    sweep: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    one_at_a_time: bool = False,
    convergence: str | None = None,
    reach: str | None = None,
    seconds: str | None = None,
    claims: bool = False,
    against: bool = False,
    model: str | None = None,
    seeds: int | None = None,
    background: Literal["panorama", "truth"] | None = None,
    video: bool = False,
    device: str | None = None,
    json: bool = False,
    markdown: bool = False,
    html: Path | None = None,
    allow_outside: bool = False,
) -> int:
    """Time the frames of a head that turns slowly, or score still pictures against seconds.

    Every frame is rendered for a new direction, rasterization included; the video and the objects
    stand still. Times are medians over the frames, after a warm-up. --sweep times every combination
    of settings, scores still pictures made with them against the truth, and marks the combinations
    that none other beats in both (the Pareto front). --convergence scores a still picture again and
    again while it gets better, and shows the seconds spent. --seconds scores what each combination
    makes of equal times, and shows what their frames cost. --against does so beside Mitsuba on the
    same cores, and shows the seconds that each needs.

    Parameters
    ----------
    scene
        Scene folder.
    view
        Name of a view of the scene, or `equirect` for the whole panorama, which is rendered anew
        for every frame instead of turning. Default: the scene's first view. With --sweep,
        --convergence, --seconds and --against there may be several, separated by commas or with
        --view again; default: all views that have a truth.
    size
        Width and height in pixels. Default: the view's own. With --sweep, --convergence, --seconds
        and --against, the size of the truth divided by a whole number.
    frames
        Frames to time; with --sweep also the frames accumulated in each picture; with --seconds
        those of the last picture, which may take any time. Default: 30; with --seconds 256.
    method
        How virtual objects are lit: a name from `iprt methods`. Short for --set method=.
    setting_flags
        Quality preset and single settings. Later ones win: preset, file, flags.
    sweep
        Values of a setting to measure, such as trace.rays=1,2, quality=draft,balanced or
        method=all; may be given several times, for all combinations.
    one_at_a_time
        With --sweep: change one setting at a time, instead of all combinations.
    convergence
        Frames after which the picture is scored, such as 1,2,4,8 or 1,2,...,256. With --against,
        of Mitsuba it is samples per pixel, and 1,2,...,64 is the default.
    reach
        With --convergence and --against: values of SSIM in the cuts; a table shows the time until
        each is reached. Default: 0.9,0.93,0.95.
    seconds
        Times per picture, such as 0.2,1,5. What is scored is the last picture finished in time, and
        one more of --frames.
    claims
        Measure what the papers behind the methods claim, beside the papers' figures, and say what
        holds. Views and --size as with --sweep.
    against
        Measure Mitsuba with Open Image Denoise too, in the world that the panorama describes and,
        with --model, in the full geometry. Each renderer has its own process, and they take turns.
        Seconds are those of a picture; what a process does once is shown apart.
    model
        With --against: Python module with the scene's full geometry, as for `iprt reference`.
    seeds
        Pictures per combination, each from another seed, for means and confidence intervals.
        Default: 3.
    background
        What the camera sees behind the objects where pictures are scored: the resampled panorama,
        or the truth's own background. Default: truth.
    video
        Time instead how fast frames of the video come in: from decoded pictures to what rays need,
        without decoding and without rendering. --size enlarges the panorama to that many pixels.
    device
        gpu, cpu, a place such as 0:0 (see `iprt doctor`), or part of a device's name. Default: the
        fastest kind there is.
    json
        Print a JSON object instead of a table.
    markdown
        Print Markdown tables, for a page.
    html
        Page to write: table, plot and pictures, in one file.
    allow_outside
        Follow links in the scene's folder to files outside of it.

    Returns
    -------
    int
        Exit status 0.
    """
    if frames is not None and not 1 <= frames <= MAX_FRAMES:
        raise IprtError(f"--frames {frames}: expected 1 to {MAX_FRAMES}")
    if seeds is not None and not 1 <= seeds <= MAX_SEEDS:
        raise IprtError(f"--seeds {seeds}: expected 1 to {MAX_SEEDS}")
    if json and markdown:
        raise IprtError("--json and --markdown: give one of them")
    followed = against or convergence is not None
    if seconds is not None and (followed or seeds is not None):
        raise IprtError("--seconds: does not go with --convergence, --against and --seeds")
    if claims and (sweep or followed or seconds is not None or seeds is not None or method):
        raise IprtError("--claims: says what is measured; leave out --method, --sweep and the like")
    view = listed(view)
    against_truth = bool(sweep) or followed or seconds is not None or claims
    of_truth = {
        "--html": html,
        "--markdown": markdown,
        "--seeds": seeds,
        "--background": background,
    }
    _require_use(against_truth, TRUTH_FLAGS, of_truth)
    _require_use(bool(sweep), "--sweep", {"--one-at-a-time": one_at_a_time})
    _require_use(followed, "--convergence or --against", {"--reach": reach})
    _require_use(against, "--against", {"--model": model})
    if followed and frames is not None:
        raise IprtError(f"--frames {frames}: has no effect; --convergence says how many frames")
    frames = frames or (FRAMES if seconds is None else CONVERGED)
    if video:
        if against_truth or view:
            raise IprtError("--video: renders nothing; leave out --view, --sweep and the like")
        return _time_video(scene, size, frames, method, setting_flags, device, json, allow_outside)
    if not against_truth:
        return _time(scene, view, size, frames, method, setting_flags, device, json, allow_outside)

    from iprt.commands.bench_against import measure_against
    from iprt.commands.bench_truth import (
        Output,
        Plan,
        measure_claims,
        measure_convergence,
        measure_equal_time,
        measure_sweep,
    )
    from iprt.measure.sweep import combinations
    from iprt.scene.scene import Scene
    from iprt.truth.backend import require_reference

    assignments = setting_flags.assignments(method=method)
    chosen = combinations(setting_flags.quality, assignments, sweep, one_at_a_time=one_at_a_time)
    if against:
        require_reference()
    opened = Scene.open(scene, allow_outside=allow_outside)
    plan = Plan.of(
        opened, view, size, background or "truth", device, chosen, 1 if seconds else seeds or SEEDS
    )
    output = Output(json=json, markdown=markdown, html=html)
    output.require_writable(plan.scene)
    if against:
        return measure_against(
            plan,
            convergence or COUNTS,
            reach or LEVELS,
            model,
            output,
            device=device,
            allow_outside=allow_outside,
        )
    if claims:
        return measure_claims(plan, frames, output)
    if seconds is not None:
        return measure_equal_time(plan, seconds, frames, output)
    if convergence is None:
        return measure_sweep(plan, frames, output)
    return measure_convergence(plan, convergence, reach or LEVELS, output)


def _require_use(used: bool, flag: str, needing: Mapping[str, object]) -> None:
    for name, value in needing.items():
        if value and not used:
            raise IprtError(f"{name}: is for {flag}")


def _time_video(
    scene: Path,
    size: tuple[int, int] | None,
    frames: int,
    method: str | None,
    setting_flags: SettingFlags,
    device: str | None,
    json: bool,
    allow_outside: bool,
) -> int:
    from json import dumps

    from iprt.commands.progress import progress_bar
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.frame_preparation import WARM_UP, time_preparation
    from iprt.output.grid import print_grid
    from iprt.scene.scene import Scene

    if size is not None and size[0] != 2 * size[1]:
        raise IprtError(f"--size {size[0]} {size[1]}: a panorama is twice as wide as high")
    settings = setting_flags.resolved(method=method)
    opened = Scene.open(scene, allow_outside=allow_outside)
    compute = ComputeDevice(choose_device(device))
    with progress_bar("timing", WARM_UP + frames) as progress:
        found = time_preparation(
            compute, opened, settings, frames=frames, size=size, progress=progress
        )
    if json:
        print(dumps(found.record(), indent=2))
    else:
        print_grid(found.grid())
    return 0


def _time(
    scene: Path,
    views: tuple[str, ...],
    size: tuple[int, int] | None,
    frames: int,
    method: str | None,
    setting_flags: SettingFlags,
    device: str | None,
    json: bool,
    allow_outside: bool,
) -> int:
    from iprt.commands.progress import progress_bar
    from iprt.commands.views import choose_view
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.bench import WARM_UP, timed
    from iprt.measure.camera_motion import Turn
    from iprt.measure.profile_file import json_text
    from iprt.measure.table import pass_grid
    from iprt.memory import require_memory
    from iprt.output.grid import print_grid
    from iprt.scene.scene import Scene

    if len(views) > 1:
        raise IprtError(
            f"--view {views[1]}: only one view is timed, unless --sweep, --convergence or "
            "--against is given"
        )
    settings = setting_flags.resolved(method=method)
    opened = Scene.open(scene, allow_outside=allow_outside)
    chosen, objects = choose_view(opened, views[0] if views else None, size=size)
    instances = opened.instances if objects is None else opened.instances_named(objects)
    frame = opened.frame()
    compute = ComputeDevice(choose_device(device))
    require_memory(compute, frame, instances, chosen, settings)
    with progress_bar("timing", WARM_UP + frames) as progress:
        turn = Turn(frame, instances, chosen, settings)
        result = timed(compute, turn, scene=opened.name, frames=frames, progress=progress)
    if json:
        print(json_text(result))
    else:
        print_grid(pass_grid(result))
    return 0
