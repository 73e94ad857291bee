"""`iprt race`: what is asked of renderers, and what is made of their pictures."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt import cli
from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError, SceneError
from iprt.measure.combinations import combinations, still_settings
from iprt.measure.convergence_curves import Curve, Point
from iprt.measure.intervals import Estimate
from iprt.measure.time_to_accuracy import RaceResult, Track, run_race
from iprt.measure.time_to_accuracy_report import race_grid
from iprt.measure.timed_renderers import (
    FULL,
    PANORAMA,
    RacedRenderer,
    RacedView,
    TimedRenderer,
    raced_iprt,
)
from iprt.measure.view_truth import Radiance, ScoreEstimates, Scores, read_target
from iprt.output.picture import write_exr
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.overrides import parse_assignment
from tests.measure.tiny import write_tiny

ROOT = Path(__file__).parents[2]
BLACK = np.zeros((36, 48, 3), np.float32)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The truth is grey."""
    folder = write_tiny(tmp_path_factory.mktemp("race") / "room", "near")
    write_exr(folder / "truth.exr", np.full_like(BLACK, 0.5))
    return folder


def view_of(scene: Path) -> RacedView:
    return RacedView(scene, False, read_target(Scene.open(scene), "near", "truth"))


# What is made of pictures ----------------------------------------------------------------------


def scores(*cuts: float) -> Scores:
    return Scores(0.5, cuts, 30.0, 0.0, 0.0, None)


def test_who_is_good_enough_in_all_cuts_is_asked_for_no_more() -> None:
    track = Track([1, 2, 4, 8], 0.9)
    for count, found in ((1, (0.95, 0.8)), (2, (0.8, 0.95)), (4, (0.9, 0.91))):
        assert count in track.counts
        track.add(0, float(count), scores(*found), BLACK)
    assert track.counts == [1, 2, 4]
    for count in track.counts:
        track.add(1, 3.0 * count, scores(0.99, 0.99), BLACK)
    assert track.counts == [1, 2, 4], "the first seed decides"
    points = track.curve("near", "a").points
    assert [point.count for point in points] == [1, 2, 4]
    assert [point.seconds.mean for point in points] == [2.0, 4.0, 8.0]
    assert points[0].scores.ssim_cuts[1].mean == pytest.approx(0.5 * (0.8 + 0.99))


def test_a_view_without_cuts_counts_as_a_whole() -> None:
    track = Track([1, 2], 0.5)
    track.add(0, 1.0, scores(), BLACK)
    assert track.counts == [1]


def result(label: str, once: float, *points: tuple[float, float]) -> RaceResult:
    """Of (seconds, SSIM of the cut)."""
    made = tuple(
        Point(2**i, Estimate(s, None), ScoreEstimates.of([scores(ssim)]))
        for i, (s, ssim) in enumerate(points)
    )
    return RaceResult(once, Curve("near", label, made))


def test_table_of_levels() -> None:
    """Reached at once, between pictures, by one of them only, and by none."""
    ours = result("iprt", 3.04, (1.0, 0.8), (4.0, 0.9), (16.0, 0.93))
    theirs = result(FULL, 7.0, (2.0, 0.6), (8.0, 0.8), (32.0, 0.9), (128.0, 0.94))
    grid = race_grid([[ours, theirs]], [0.8, 0.85, 0.94, 0.96], "on two cores")
    assert grid.columns == ("view", "cut", "SSIM", "iprt", FULL)
    assert grid.rows == (
        ("near", "once", "", "3.0", "7.0"),
        ("near", "cut 1", "0.8", "1.00", "8.00 (8.0x)"),
        ("near", "cut 1", "0.85", "2.00", "16.00 (8.0x)"),
        ("near", "cut 1", "0.94", "not reached (best 0.9300)", "128.00"),
        ("near", "cut 1", "0.96", "not reached (best 0.9300)", "not reached (best 0.9400)"),
    )
    assert "on two cores" in grid.notes
    assert not any("left out" in note for note in grid.notes)


def test_a_missing_geometry_is_named() -> None:
    both = [result("iprt", 1.0, (1.0, 0.8)), result(PANORAMA, 1.0, (1.0, 0.8))]
    assert race_grid([both], [0.8]).notes[-1].startswith(f"{FULL}: left out")


# Processes -------------------------------------------------------------------------------------

SLOW_START_S = 0.3


def pretender(label: str, fault: str = "") -> RacedRenderer:
    """Paints the truth's grey, of 0.5, at 4 samples and darker at fewer. `fault`: what it does."""
    return RacedRenderer(label, partial(load, fault))


def load(fault: str, view: RacedView) -> TimedRenderer:
    if fault == "error":
        raise SceneError("nothing there")
    if fault == "end":
        os._exit(3)
    time.sleep(SLOW_START_S)
    return Painter(view.target.radiance.shape)


class Painter:
    """Quick pictures take longer at first; slow ones would if they were made again."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape = shape
        self.tries: dict[tuple[int, int], int] = {}

    def prepare(self, seed: int) -> None:
        time.sleep(SLOW_START_S)

    def picture(self, count: int, seed: int) -> tuple[float, Radiance]:
        tries = self.tries[count, seed] = self.tries.get((count, seed), 0) + 1
        color = np.full(self.shape, 0.125 * count, np.float32)
        seconds = 5.0 + tries if count == 4 else 0.1 * count + 0.1 * max(3 - tries, 0) + seed
        return seconds, color


@pytest.mark.thorough
def test_processes_take_turns(scene: Path) -> None:
    done: list[int] = []
    entries = [pretender("a"), pretender("b")]
    ((results, target, colors),) = run_race(
        [view_of(scene)], entries, [1, 2, 4, 8], enough=0.999, seeds=2, progress=done.append
    )
    assert target.name == "near"
    assert [result.curve.label for result in results] == ["a", "b"]
    for found in results:
        assert [point.count for point in found.curve.points] == [1, 2, 4]
        assert [p.seconds.mean for p in found.curve.points] == pytest.approx([0.65, 0.8, 6.0])
        assert 2 * SLOW_START_S - 0.1 < found.once < 60.0
    for color in colors:
        np.testing.assert_array_equal(color, np.full_like(BLACK, 0.5))
    assert done == list(range(1, 17))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("fault", "message"), [("error", "nothing there"), ("end", "a: its process has ended early")]
)
def test_what_goes_wrong_there_is_told_here(scene: Path, fault: str, message: str) -> None:
    entries = [pretender("b"), pretender("a", fault)]
    with pytest.raises(IprtError, match=message):
        list(run_race([view_of(scene)], entries, [1], enough=1.0, seeds=1))


@pytest.mark.thorough
def test_a_signal_ends_the_processes_too(scene: Path) -> None:
    """With one line; the output is open as long as one of them lives."""
    code = (
        "import os, signal, time; from pathlib import Path\n"
        "from iprt.files.termination import end_on_signals\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler); end_on_signals()\n"
        "from iprt.measure.time_to_accuracy import renderer_process\n"
        "from tests.measure.test_time_to_accuracy import pretender, view_of\n"
        f"with renderer_process(pretender('a'), view_of(Path({str(scene)!r}))) as process:\n"
        "    print(process.label, flush=True)\n"
        "    os.killpg(0, signal.SIGINT); time.sleep(1000)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        start_new_session=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "a\n", "iprt: interrupted\n")


# Renderers -------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.gl
def test_pictures_of_iprt_are_those_of_a_renderer_of_its_own(
    device: ComputeDevice, scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever was rendered before, of this seed or another. A frame takes one second here."""
    frames = 0
    step = Renderer.step

    def counted(renderer: Renderer) -> None:
        nonlocal frames
        frames += 1
        step(renderer)

    monkeypatch.setattr(Renderer, "step", counted)
    view = view_of(scene)
    (combination,) = combinations("draft", [parse_assignment("--set", "trace.rays=2")], [])
    renderer = raced_iprt(combination, os.environ.get("IPRT_TEST_DEVICE", "pocl")).load(view)
    renderer.prepare(0)
    wanted = ((0, 1), (0, 3), (0, 1), (1, 3))
    with monkeypatch.context() as clock:
        clock.setattr("iprt.measure.timed_renderers.time.perf_counter", lambda: float(frames))
        made = [(seed, count, *renderer.picture(count, seed)) for seed, count in wanted]
    assert [seconds for _, _, seconds, _ in made] == [1.0, 3.0, 1.0, 3.0]
    for seed, count, _, color in made:
        settings = still_settings(combination.settings, seed)
        frame, objects = view.frame(), view.instances()
        with Renderer(
            device, frame, objects, view.target.view, settings,
            background=view.target.background,
        ) as renderer:  # fmt: skip
            np.testing.assert_array_equal(color, renderer.render(count).color)


def test_labels_say_what_was_changed() -> None:
    base, changed = combinations("balanced", [], ["trace.rays=2"], one_at_a_time=True)
    assert [raced_iprt(c, None).label for c in (base, changed)] == ["iprt", "iprt, trace.rays=2"]


@pytest.mark.parametrize("module", ["mitsuba", pytest.param("pyoidn", marks=pytest.mark.mitsuba)])
def test_what_is_not_installed_is_one_line(
    module: str, scene: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[..., str]
) -> None:
    if module == "pyoidn":
        pytest.importorskip("mitsuba")
    monkeypatch.setitem(sys.modules, module, None)
    line = fails("race", scene)
    assert f"no module {module}: pip install 'iprt[reference]'" in line


@pytest.mark.mitsuba
def test_bad_values_are_one_line(scene: Path, fails: Callable[..., str]) -> None:
    pytest.importorskip("mitsuba")
    pytest.importorskip("pyoidn")
    for words, message in (
        (["--model", "no.such.module"], "--model no.such.module: no such module"),
        (["--reach", "2"], "--reach 2: expected values of SSIM"),
        (["--accumulate", "2,1"], "--accumulate 2,1: expected rising numbers"),
    ):
        assert message in fails("race", scene, "--device", "pocl", *words)


@pytest.mark.gl
@pytest.mark.mitsuba
@pytest.mark.thorough
def test_mitsuba_finds_the_picture_that_it_made(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its own picture as truth, in either world, at the number of samples that made it."""
    pytest.importorskip("mitsuba")
    pytest.importorskip("pyoidn")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny_model.py").write_text(
        'def build():\n    return {"sky": {"type": "constant", "radiance": 0.5}}\n'
    )
    model = ["--model", "tiny_model"]
    quick = ["--device", "pocl", "--method", "ibl", "--background", "panorama"]
    words = [*model, *quick, "--accumulate", "1,2,4", "--seeds", 1, "--reach", 1]
    before = (scene / "truth.exr").read_bytes()
    for made, label in ((model, FULL), ([], PANORAMA)):
        run("reference", scene, "-o", scene / "truth.exr", "--spp", 2, *made)
        capsys.readouterr()
        try:
            run("race", scene, *words, "--json")
        finally:
            (scene / "truth.exr").write_bytes(before)
        found: dict[str, Any] = json.loads(capsys.readouterr().out)
        results = {result["curve"]["label"]: result for result in found["views"][0]}
        assert list(results) == ["iprt", FULL, PANORAMA]
        for other in results.values():
            points = other["curve"]["points"]
            assert [point["count"] for point in points][:2] == [1, 2]
            assert all(point["seconds"]["mean"] > 0.0 for point in points)
        best = [point["scores"]["ssim"]["mean"] for point in results[label]["curve"]["points"]]
        assert best[1] == pytest.approx(1.0, abs=1e-6)
        assert best[0] < 0.9999
        assert results[label]["once"] > 0.1


def run(*words: object) -> None:
    assert cli.main([str(word) for word in words]) == 0
