"""`iprt equal-time`: who gets how far in equal time, and what frames cost."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from iprt import cli
from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.measure import bench
from iprt.measure.combinations import combinations
from iprt.measure.equal_time import costs_of, parse_seconds, pictures_within
from iprt.measure.view_truth import Radiance
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.methods import methods
from iprt.settings.model import Settings
from tests.measure.tiny import write_tiny


class Clockwork:
    """The first frame takes 300 ms, every other 100; a picture's value is its number of frames."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def prepare(self, seed: int) -> None: ...

    def picture(self, count: int, seed: int) -> tuple[float, Radiance]:
        self.asked.append(count)
        return 0.2 + 0.1 * count, np.full((1, 1, 3), count, np.float32)


def test_the_last_picture_in_time_counts_or_the_first() -> None:
    renderer = Clockwork()
    found = pictures_within(renderer, [0.1, 0.35, 0.45, 1.0, 1.05])
    assert [count for count, *_ in found] == [1, 1, 2, 8, 8]
    assert all(seconds == pytest.approx(0.2 + 0.1 * count) for count, seconds, _ in found)
    assert all(color.item(0) == count for count, _, color in found)
    assert renderer.asked == list(range(1, 10)), "each frame once"


def test_times_rise() -> None:
    assert parse_seconds("0.2, 1,5") == [0.2, 1.0, 5.0]
    for text in ("", "0", "-1", "1,1", "2,1", "nan", "inf", "1e9", "a", "1,"):
        with pytest.raises(IprtError, match="expected rising times"):
            parse_seconds(text)


def test_all_methods_can_be_swept() -> None:
    found = combinations("balanced", [], ["method=all"])
    assert [combination.settings.method for combination in found] == list(methods())


def test_costs_belong_to_the_frames_that_have_them(
    tmp_path: Path, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clock that the renderer's work turns: 1 s a frame, 2 s to load, 4 s to move, 8 to stop."""
    scene = Scene.open(write_tiny(tmp_path / "room", "near"))
    now = [0.0]
    done: dict[Renderer, list[str]] = {}

    def slow(name: str, seconds: float) -> None:
        plain = getattr(Renderer, name)

        def slower(self: Renderer, *arguments: object) -> None:
            before = done.setdefault(self, [])
            now[0] += seconds
            now[0] += 8.0 * (before[-2:] == ["move", "step"])  # the second frame after a move
            before.append(name)
            plain(self, *arguments)

        monkeypatch.setattr(Renderer, name, slower)

    slow("step", 1.0)
    slow("load", 2.0)
    slow("move", 4.0)
    clock = SimpleNamespace(perf_counter=lambda: now[0], thread_time=lambda: 0.0)
    monkeypatch.setattr(bench, "time", clock)
    settings = Settings(method="ibl")
    frame, view = scene.frame(0), scene.views["near"].view
    costs = costs_of(device, frame, scene.instances, view, settings)
    assert (costs.frame, costs.video, costs.objects) == (1000.0, 2000.0, 12000.0)
    assert len(done) == 3, "one renderer for each kind of change"
    with Renderer(device, frame, scene.instances, view, settings) as renderer:
        assert costs.bytes > renderer.composite.picture.nbytes
    alone = costs_of(device, frame, (), replace(view, projection="equirect"), settings)
    assert (alone.frame, alone.video, alone.objects) == (1000.0, 2000.0, 0.0)


@pytest.mark.thorough
@pytest.mark.gl
def test_results_hold_all_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_tiny(tmp_path / "room", "near")
    words = ["equal-time", str(folder), "--seconds", "0.01,0.5", "--accumulate", "3"]
    words += ["--device", "pocl", "--sweep", "method=ibl,em", "--html", str(tmp_path / "page.html")]
    assert cli.main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["results"]
    chosen = [result["combination"]["settings"]["method"] for result in found]
    assert chosen == ["ibl", "em"]
    for result in found:
        first, second, last = result["pictures"]
        assert [picture["budget"] for picture in (first, second, last)] == [0.01, 0.5, None]
        assert second["frames"] == 1 or second["seconds"] <= 0.5
        assert (first["frames"], last["frames"]) == (1, 3) or first["seconds"] <= 0.01
        assert len(last["scores"]["ssim_cuts"]) == 2
        assert result["costs"]["bytes"] > 0
    page = (tmp_path / "page.html").read_text()
    assert all(word in page for word in ("0.01 s", "0.5 s", "3 frames", "truth", "method=em"))
    assert cli.main(words) == 0
    assert "0.5 s" in capsys.readouterr().out
