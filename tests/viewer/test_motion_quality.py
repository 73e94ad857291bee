"""Quality in motion, on simulated devices: it holds the target, settles, and recovers at rest."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iprt.device.profile import PassTime
from iprt.footage.properties import Footage
from iprt.geometry.material import Material
from iprt.renderer import RenderedFrame
from iprt.settings.features import Features
from iprt.settings.ladder import LADDER, entry_settings
from iprt.settings.model import Settings
from iprt.settings.overrides import changed, plain_values, resolved
from iprt.settings.presets import Quality
from iprt.viewer.motion_quality import (
    MOST_UP_S,
    SCALES,
    UP_S,
    Level,
    MotionQuality,
    QualityController,
    levels_below,
)
from iprt.viewer.session import Shown
from iprt.viewer.state import Request
from tests.measure.tables import made_table
from tests.viewer.turns import VIEW

FPS = 30.0
TABLE = made_table()
LEAST = changed(Settings(), entry_settings(next(iter(LADDER))))
"""The settings of the quickest entry."""


def taken(seconds: float, passes_s: tuple[float, ...], *, compiled: bool) -> Shown:
    """A first picture at full quality."""
    passes = tuple(PassTime("pass", 1e3 * pass_s, 0.0, 1) for pass_s in passes_s)
    request = Request(VIEW)
    color = RenderedFrame(np.zeros((1, 1, 3), np.float32), {})
    return Shown(
        0, 1, request, 0, color, None, None, 1, None, passes, seconds, "device", compiled
    )  # fmt: skip


def test_the_first_picture_tells_how_slow_frames_are() -> None:
    """Whatever compilers took; so that the first drag has previews from its start."""
    for picture, quick in (
        (taken(60.0, (0.004, 0.006), compiled=True), True),
        (taken(60.0, (0.5, 1.0), compiled=True), False),
        (taken(60.0, (), compiled=True), True),  # not profiled
        (taken(0.01, (), compiled=False), True),
        (taken(1.5, (), compiled=False), False),
    ):
        motion = MotionQuality(FPS, TABLE, lambda: 0.0)
        motion.observe(picture)
        assert motion.level(Settings(), playing=False) is None
        motion.stir()
        assert (motion.level(Settings(), playing=False) is None) == quick


def paced(
    base: Settings | None = None, fps: float = FPS, usual_s: float | None = None
) -> QualityController:
    return QualityController(fps, base or Settings(), TABLE, usual_s=usual_s)


class Simulated:
    """A device whose frames take `fixed` of a load however few their pixels are.

    `rays` is what the quicker settings take relative to what the table says; `load` is seconds at
    level 0, by frame. Frames
    take longer just after a change, and now and then one waits for something else.
    """

    def __init__(
        self,
        pace: QualityController,
        load: Callable[[int], float],
        *,
        fixed: float = 0.0,
        rays: float = 1.0,
        noise: float = 0.1,
        seed: int = 0,
    ) -> None:
        self.pace, self.load, self.fixed, self.rays, self.noise = pace, load, fixed, rays, noise
        self.random = np.random.default_rng(seed)
        self.seconds: list[float] = []
        self.numbers: list[int] = []  # of the level that each frame was rendered at

    def share(self, level: Level) -> float:
        rays = self.rays if level.preview is not None else 1.0
        return self.fixed + (1.0 - self.fixed) * rays * level.share

    def play(self, frames: int) -> None:
        for _ in range(frames):
            level, index = self.pace.level, len(self.seconds)
            number = list(self.pace.levels).index(level)
            stood = 0
            while stood < 8 and stood < index and self.numbers[-1 - stood] == number:
                stood += 1
            wait = 1.0 + 3.0 * (self.random.random() < 0.02 * (self.noise > 0.0))
            time = self.load(index) * self.share(level) * (1.0 + 0.2 * 0.5**stood) * wait
            time *= float(np.exp(self.noise * self.random.standard_normal()))
            self.numbers.append(number)
            self.seconds.append(time)
            self.pace.observe(time, compiled=False)

    @property
    def changes(self) -> list[int]:
        """Frames at which the level changed."""
        return [i for i, (a, b) in enumerate(pairwise(self.numbers), 1) if a != b]


@pytest.mark.parametrize("load", [0.02, 0.0395, 0.07, 0.12, 0.3])
def test_it_goes_at_once_where_the_target_is_held_and_no_further(load: float) -> None:
    """Where time goes with the pixels, as it expects."""
    device = Simulated(paced(), lambda _: load, noise=0.0)
    device.play(1000)
    assert len(device.changes) <= 2
    level = device.numbers[-1]
    assert device.seconds[-1] < 1.1 / FPS
    assert not level or load * device.share(device.pace.levels[level - 1]) > 0.75 / FPS


@pytest.mark.parametrize("load", [0.02, 0.0395, 0.07, 9.0])
def test_what_is_known_of_a_frame_as_asked_for_saves_the_search(load: float) -> None:
    pace = paced(usual_s=load)
    device = Simulated(pace, lambda _: load, noise=0.0)
    device.play(300)
    assert len(set(device.numbers)) == 1
    assert (device.numbers[0] == 0) == (load < 1.0 / FPS)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("fixed", [0.0, 0.15])
def test_a_step_of_the_load_is_followed_in_a_few_frames_and_taken_back(
    fixed: float, seed: int
) -> None:
    before, during, step, end = 0.022, 0.07, 300, 1000
    device = Simulated(
        paced(),
        lambda i: during if step <= i < end else before,
        fixed=fixed,
        seed=seed,
    )
    device.play(3000)
    assert set(device.numbers[20:step]) == {0}
    assert np.mean(device.seconds[step + 30 : end]) < 1.1 / FPS
    # Up again a wait and a window later, and perhaps in more than one stride.
    assert set(device.numbers[-1000:]) == {0}


def test_going_up_never_overshoots_where_only_the_number_of_pixels_changes() -> None:
    """However much of a frame's time its pixels do not change."""
    for fixed in np.linspace(0.0, 0.6, 7):
        pace = paced(LEAST)
        load = 0.9 / FPS / (fixed + (1.0 - fixed) * 0.25**2)
        device = Simulated(
            pace, lambda i, load=load: load / (1 + 0.002 * i), fixed=fixed, rays=1.0, noise=0.0
        )
        device.play(4000)
        up = [i for i in device.changes if device.numbers[i] < device.numbers[i - 1]]
        assert len(up) > 2
        for i in up:
            assert max(device.seconds[i + 3 : i + 20]) < 1.0 / FPS, (fixed, i)


def test_a_level_that_disappoints_is_tried_ever_more_rarely() -> None:
    """A device on which few rays are what saves most: level 0 looks as if it would do."""
    device = Simulated(paced(), lambda _: 0.045, rays=0.3, fixed=0.1, noise=0.0)
    device.play(10000)
    failures = np.cumsum(device.seconds)[[i for i in device.changes if device.numbers[i] == 0]]
    waits = np.diff(failures)
    assert len(waits) > 2
    assert all(b > 1.7 * a for a, b in pairwise(waits) if b < MOST_UP_S)
    assert waits.min() > UP_S
    assert np.mean(np.array(device.numbers[200:]) > 0) > 0.97


def test_nothing_holds_the_target() -> None:
    device = Simulated(paced(fps=240.0), lambda _: 1.0)
    device.play(200)
    assert set(device.numbers[30:]) == {len(device.pace.levels) - 1}


@pytest.mark.thorough
@settings(max_examples=40)
@given(
    fixed=st.floats(0.0, 0.6),
    rays=st.floats(0.3, 1.05),
    loads=st.lists(st.floats(0.002, 0.4), min_size=1, max_size=4),
    noise=st.floats(0.0, 0.2),
    seed=st.integers(0, 1000),
)
def test_whatever_the_device_it_does_not_hunt(
    fixed: float, rays: float, loads: list[float], noise: float, seed: int
) -> None:
    length = 1200
    device = Simulated(
        paced(),
        lambda i: loads[min(i // length, len(loads) - 1)],
        fixed=fixed,
        rays=rays,
        noise=noise,
        seed=seed,
    )
    device.play(length * len(loads))
    assert len(device.changes) <= 20 * len(loads)
    quickest = device.share(device.pace.levels[-1])
    if quickest * loads[-1] < 0.7 / FPS:
        assert np.median(device.seconds[-length // 4 :]) < 1.2 / FPS


def test_frames_that_compile_do_not_count() -> None:
    plain, disturbed = (paced() for _ in range(2))
    random = np.random.default_rng(1)
    for index in range(600):
        time = 0.06 * plain.level.share * float(random.uniform(0.9, 1.1))
        if index % 3 == 0:
            disturbed.observe(5.0, compiled=True)
        plain.observe(time, compiled=False)
        disturbed.observe(time, compiled=False)
        assert plain.level.share == disturbed.level.share
    assert plain.level.share < 1.0


@pytest.mark.parametrize("quality", get_args(Quality))
def test_levels_start_from_what_was_asked_for_and_never_exceed_it(quality: Quality) -> None:
    base = changed(resolved(quality), {"seed": 7, "trace.object_rays": 3})
    levels = levels_below(base, TABLE)
    assert (levels[0].settings, levels[0].scale, levels[0].preview) == (base, 1.0, None)
    own = plain_values(base)
    for above, below in pairwise(levels):
        assert below.share < above.share
        assert below.scale <= above.scale
        assert below.settings is not above.settings
        now = plain_values(below.settings)
        assert now["light_scale"] >= own["light_scale"]
        fewer = own.keys() - {"light_scale"}
        assert all(now[k] <= own[k] for k in fewer if now[k] != own[k])
    assert [level.scale for level in levels if level.scale < 1.0] == list(SCALES)


@pytest.mark.parametrize("own", [1, 2, 3, 4, 8])
def test_the_picture_is_sharp_as_long_as_light_can_be_coarser(own: int) -> None:
    levels = levels_below(changed(Settings(), {"light_scale": own}), TABLE)
    scales = [level.settings.light_scale for level in levels if level.scale == 1.0]
    known = {int(str(entry_settings(name)["light_scale"])) for name in LADDER}
    assert scales == sorted(scales)
    assert set(scales) == {own, *(scale for scale in known if scale > own)}
    assert all(level.settings.light_scale == 8 for level in levels if level.scale < 1.0)


def test_who_asked_for_least_is_left_with_resolution() -> None:
    levels = levels_below(LEAST, TABLE)
    assert [level.scale for level in levels] == [1.0, *SCALES]
    assert all(level.settings == LEAST for level in levels)


@pytest.mark.parametrize("quality", get_args(Quality))
def test_levels_share_the_real_world_of_the_picture_at_rest(quality: Quality) -> None:
    """Its panorama and E_R; another would have to be made and to converge when the head moves."""

    def world(settings: Settings) -> object:
        return Features.of([Material()], VIEW, settings, Footage()).of_real_world

    base = resolved(quality)
    levels = levels_below(base, TABLE)
    assert len(levels) > 3
    assert {world(level.settings) for level in levels} == {world(base)}
    assert world(changed(base, {"irradiance.rows": 32})) != world(base)
