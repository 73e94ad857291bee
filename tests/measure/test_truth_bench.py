"""`iprt sweep` and `iprt converge`, and their pages, on a scene of a few pixels.

The truth is a picture that the renderer itself made, so that the best settings are known.
"""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from iprt import cli
from iprt.commands.measurement import parse_levels
from iprt.errors import DeviceError, IprtError
from iprt.files.images import read_color
from iprt.measure import sweep
from iprt.measure.combinations import combinations, still_settings
from iprt.measure.convergence_curves import Curve, Point, parse_counts, seconds_to
from iprt.measure.intervals import Estimate
from iprt.measure.view_truth import ScoreEstimates, read_target
from iprt.scene.scene import Scene
from iprt.settings.overrides import parse_assignment, resolved
from iprt.settings.presets import PRESETS
from tests.measure.pages import Page, page_of
from tests.measure.tiny import write_tiny

FRAMES = 2
QUICK = ["--method", "ibl", "--device", "pocl"]
"""Objects are lit by rays in this method too, and by little else."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two equal views with one truth: the picture of two rays, two frames and seed 0."""
    folder = write_tiny(tmp_path_factory.mktemp("bench") / "room", "near", "again")
    render(folder, folder / "truth.exr", "trace.object_rays=2")
    return folder


def render(scene: Path, output: Path, *settings: str, frames: int = FRAMES) -> None:
    words = ["render", str(scene), "-o", str(output), "--accumulate", str(frames), *QUICK]
    assert cli.main([*words, *(word for text in settings for word in ("--set", text))]) == 0


def run(*words: object) -> int:
    return cli.main([*map(str, words), *QUICK, "--background", "panorama"])


def measured(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    capsys.readouterr()
    assert run(*words, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


# What is asked for -----------------------------------------------------------------------------


def test_all_combinations_or_one_change_at_a_time() -> None:
    sweeps = ["trace.rays=1,2", "mask.sparse=true,false"]
    product = [dict(c.values) for c in combinations("balanced", [], sweeps)]
    assert product == [{"trace.rays": r, "mask.sparse": s} for r in (1, 2) for s in (True, False)]
    base, *others = combinations(
        "balanced", [parse_assignment("--set", "trace.rays=2")], sweeps, one_at_a_time=True
    )
    assert (base.label, base.settings.trace.rays) == ("base", 2)
    assert [other.label for other in others] == ["trace.rays=1", "mask.sparse=false"]
    assert others[1].settings.trace.rays == 2


def test_presets_can_be_swept_below_what_is_set() -> None:
    given = [parse_assignment("--set", "seed=4")]
    found = combinations("draft", given, ["quality=accurate,balanced"])
    key, value = next(iter(PRESETS["accurate"].items()))
    assert knob_of(found[0].settings, key) == value != knob_of(found[1].settings, key)
    assert [combination.settings.seed for combination in found] == [4, 4]


def test_still_pictures_average_all_frames_from_one_seed_each() -> None:
    settings = resolved("accurate", [parse_assignment("--set", "seed=2147483646")])
    for seed, expected in ((0, 2**31 - 2), (1, 2**31 - 1), (2, 0)):
        still = still_settings(settings, seed)
        assert (still.seed, still.fading) == (expected, 0.0)
        assert still.trace == settings.trace


def knob_of(settings: Any, key: str) -> Any:
    for name in key.split("."):
        settings = getattr(settings, name)
    return settings


BAD: dict[str, tuple[str, list[str], str]] = {
    "nothing": ("sweep", [], "no setting to vary"),
    "no values": ("sweep", ["trace.rays"], "sweep trace.rays: expected KEY=VALUE,VALUE"),
    "a gap": ("sweep", ["trace.rays=1,,2"], "sweep trace.rays=: expected KEY=VALUE"),
    "bound": ("sweep", ["trace.rays=1,0"], "sweep trace.rays=0: expected a whole number"),
    "setting": ("sweep", ["trace.rais=1"], "did you mean trace.rays?"),
    "quality": ("sweep", ["quality=best"], "sweep quality=best: expected some of draft"),
    "fading": ("sweep", ["fading=0.1,0.5"], "has no effect on a still picture"),
    "twice": ("sweep", ["seed=1", "seed=2"], "sweep seed: is swept twice"),
    "many": (
        "sweep",
        ["seed=" + ",".join(map(str, range(1001)))],
        "1001 combinations; at most",
    ),
    "seeds": ("sweep", ["seed=1", "--seeds", "0"], "--seeds 0: expected 1 to 100"),
    "size": ("sweep", ["seed=1", "--size", "40", "30"], "--size 40 30: the truth of view 'near'"),
    "no size": ("sweep", ["seed=1", "--size", "0", "0"], "--size 0 0: the truth of view 'near'"),
    "view": ("sweep", ["seed=1", "--view", "far"], "no view is named 'far'"),
    "formats": ("sweep", ["seed=1", "--json", "--markdown"], "--json and --markdown"),
    "frames": ("sweep", ["seed=1", "--accumulate", "0"], "--accumulate 0: expected 1 to"),
    "page in place": ("sweep", ["seed=1", "--html", "ROOM/truth.exr/a.html"], "not a folder"),
    "scene's file": ("sweep", ["seed=1", "--html", "ROOM/scene.toml"], "belongs to the scene"),
    "alone": ("converge", ["--one-at-a-time"], "--one-at-a-time: needs --sweep"),
    "counts": ("converge", ["--accumulate", "4,2"], "--accumulate 4,2: expected rising numbers"),
    "levels": ("converge", ["--reach", "1.5"], "--reach 1.5: expected values of SSIM"),
    "seconds": ("equal-time", ["--seconds", "1,0.5"], "--seconds 1,0.5: expected rising times"),
    "repeat": ("bench", ["--repeat", "0"], "--repeat 0: expected 1 to"),
}


@pytest.mark.parametrize(("verb", "words", "message"), BAD.values(), ids=BAD)
def test_bad_values_are_one_line(
    verb: str, words: list[str], message: str, scene: Path, fails: Callable[..., str]
) -> None:
    given = [word.replace("ROOM", str(scene)) for word in words]
    assert message in fails(verb, scene, *given)


@pytest.mark.parametrize(
    ("text", "counts"),
    [("3", [3]), ("1,2,5", [1, 2, 5]), ("1, 2,...,12", [1, 2, 4, 8, 12]), ("1,...,4", [1, 2, 4])],
)
def test_counts(text: str, counts: list[int]) -> None:
    assert parse_counts(text) == counts


@pytest.mark.parametrize("text", ["", "0", "1,1", "a", "1,...", "...,8", "1,...,4,8", "70000"])
def test_bad_counts(text: str) -> None:
    with pytest.raises(IprtError, match="expected rising numbers"):
        parse_counts(text)


def test_levels() -> None:
    assert parse_levels("0.9, 0.95") == [0.9, 0.95]
    for text in ("", "0", "nan", "a"):
        with pytest.raises(IprtError, match="--reach"):
            parse_levels(text)


# What is found ---------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.gl
def test_sweep_finds_the_settings_that_made_the_truth(
    scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["trace.object_rays=1,2", "--accumulate", FRAMES, "--seeds", 1, "--view", "near"]
    found = measured(capsys, "sweep", scene, *words)
    one, two = found["rows"]
    assert [row["combination"]["values"] for row in (one, two)] == [
        {"trace.object_rays": rays} for rays in (1, 2)
    ]
    assert two["scores"]["rmse"] == {"mean": 0.0, "half": None}
    assert two["scores"]["ssim"]["mean"] == pytest.approx(1.0)
    assert one["scores"]["rmse"]["mean"] > 1e-4
    assert one["scores"]["ssim"]["mean"] < 0.9999
    assert len(one["scores"]["ssim_cuts"]) == 2
    assert one["bench"]["wall"]["ms"] > 0.0
    assert {"trace virtual", "composite"} <= {row["name"] for row in one["bench"]["passes"]}
    assert one["combination"]["settings"]["trace"]["object_rays"] == 1


@pytest.mark.thorough
@pytest.mark.gl
def test_intervals_are_over_pictures_of_other_seeds(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["seed=5", "--accumulate", FRAMES, "--seeds", 3, "--view", "near"]
    (row,) = measured(capsys, "sweep", scene, *words)["rows"]
    target = read_target(Scene.open(scene), "near", "panorama")
    values = []
    for seed in (5, 6, 7):
        render(scene, tmp_path / "a.exr", f"seed={seed}")
        values.append(target.score(read_color(tmp_path / "a.exr")).rmse)
    assert row["scores"]["rmse"]["mean"] == pytest.approx(np.mean(values))
    half = stats.t.ppf(0.975, 2) * stats.sem(values)
    assert row["scores"]["rmse"]["half"] == pytest.approx(half)


@pytest.mark.gl
def test_convergence_passes_through_the_truth(
    scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--accumulate", "1,2,4", "--seeds", 1, "--view", "near"]
    words += ["--set", "trace.object_rays=2"]
    (curve,) = measured(capsys, "converge", scene, *words)["curves"]
    points = curve["points"]
    assert [point["count"] for point in points] == [1, 2, 4]
    assert points[1]["scores"]["ssim"]["mean"] == pytest.approx(1.0)
    assert max(points[i]["scores"]["ssim"]["mean"] for i in (0, 2)) < 0.9999
    seconds = [point["seconds"]["mean"] for point in points]
    assert 0.0 < seconds[0] < seconds[1] < seconds[2]


def test_a_smaller_size_means_means_of_the_truth(scene: Path) -> None:
    whole = read_target(Scene.open(scene), "near", "truth")
    half = read_target(Scene.open(scene), "near", "truth", (24, 18))
    assert (half.view.width, half.view.height) == (24, 18)
    for small, large in ((half.radiance, whole.radiance), (half.background, whole.background)):
        assert small is not None
        assert large is not None
        expected = sum(large[i::2, j::2].astype(np.float64) for i in (0, 1) for j in (0, 1)) / 4
        np.testing.assert_allclose(small, expected, rtol=1e-6)
    assert half.cuts == ((5, 4, 20, 16), (2, 2, 22, 17))


def test_time_to_reach_is_between_the_pictures() -> None:
    def point(seconds: float, ssim: float) -> Point:
        cuts = (Estimate(ssim, None), Estimate(ssim - 0.1, None))
        scores = ScoreEstimates(Estimate(0.5, None), cuts, Estimate(0.0, None), None)
        return Point(1, Estimate(seconds, None), scores)

    points = [point(1.0, 0.8), point(4.0, 0.9), point(16.0, 0.85), point(64.0, 0.95)]
    curve = Curve("near", "base", tuple(points))
    assert seconds_to(curve, 0, 0.7) == 1.0
    assert seconds_to(curve, 0, 0.85) == pytest.approx(2.0)
    assert seconds_to(curve, 0, 0.9) == pytest.approx(4.0)
    assert seconds_to(curve, 0, 0.925) == pytest.approx(16.0 * 4**0.75)
    assert seconds_to(curve, 1, 0.75) == pytest.approx(2.0)
    assert seconds_to(curve, 0, 0.96) is None
    # A better picture that took less time counts, in whatever order they were made.
    quicker = Curve("near", "base", (*points, point(2.0, 0.9)))
    assert seconds_to(quicker, 0, 0.9) == pytest.approx(2.0)
    assert seconds_to(quicker, 0, 0.85) == pytest.approx(2.0**0.5)


# Output ----------------------------------------------------------------------------------------


def marks_in(page: Page) -> int:
    """Marks with a hint in all plots."""
    files = [str(attrs["data"]).partition(",")[2] for attrs in page.named("object")]
    return sum(base64.b64decode(file).count(b"<title>") for file in files)


@pytest.mark.thorough
@pytest.mark.gl
def test_page_of_a_sweep_needs_nothing_else(
    scene: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    html = tmp_path / "new" / "a.html"
    words = ["trace.rays=1,2", "--accumulate", 1, "--seeds", 2, "--html", html]
    assert run("sweep", scene, *words, "--markdown") == 0
    table = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    assert len(table) == 2 + 4
    assert "8 runs: 2 combinations of settings, 2 views, 2 seeds" in caplog.text
    page = page_of(html)
    assert len(page.named("object")) == 2
    assert marks_in(page) == 4
    assert len(page.named("img")) in (4 * 3, 4 * 4)
    assert {attrs["width"] for attrs in page.named("img")} == {"40"}, "what the cuts hold"
    assert [path.name for path in html.parent.iterdir()] == ["a.html"]


@pytest.mark.thorough
@pytest.mark.gl
def test_page_of_convergence_and_of_a_comparison(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--accumulate", "1,2", "--seeds", 1, "--view", "near", "--html", tmp_path / "a.html"]
    assert run("converge", scene, *words, "--sweep", "trace.rays=1,2") == 0
    assert "Seconds to reach an SSIM" in capsys.readouterr().out
    page = page_of(tmp_path / "a.html")
    assert len(page.named("object")) == 2, "one per cut"
    assert marks_in(page) == 8
    words = ["compare", str(scene), "--accumulate", "1", "--view", "near"]
    words += ["--method", "iprt", "--method", "ibl", *QUICK[2:]]
    assert cli.main([*words, "--html", str(tmp_path / "b.html")]) == 0
    page = page_of(tmp_path / "b.html")
    assert len(page.named("img")) in (2 * 3, 2 * 4)
    assert {attrs["width"] for attrs in page.named("img")} == {"48"}


@pytest.mark.gl
def test_what_was_measured_before_an_error_is_kept(
    scene: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    whole = sweep.run_sweep

    def failing(*args: Any, **kwargs: Any) -> Any:
        yield next(whole(*args, **kwargs))
        raise DeviceError("lost")

    monkeypatch.setattr(sweep, "run_sweep", failing)
    html = tmp_path / "a.html"
    words = ["trace.rays=1,2", "--accumulate", 1, "--seeds", 1, "--view", "near"]
    assert run("sweep", scene, *words, "--json", "--html", html) == 3
    captured = capsys.readouterr()
    assert len(json.loads(captured.out)["rows"]) == 1
    assert captured.err.endswith("iprt: error: lost\n")
    assert marks_in(page_of(html)) == 1


@pytest.mark.thorough
@pytest.mark.parametrize(("results", "printed"), [("", ""), ("1", "table\n")])
def test_what_was_measured_before_a_signal_is_printed(results: str, printed: str) -> None:
    code = (
        "import os, signal, time; from iprt.files.termination import end_on_signals\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler); end_on_signals()\n"
        "from iprt.commands.measurement import printed_at_last\n"
        f"with printed_at_last([{results}], lambda: print('table')):\n"
        "    os.kill(os.getpid(), signal.SIGINT); time.sleep(1000)"
    )
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, printed, "iprt: interrupted\n")
