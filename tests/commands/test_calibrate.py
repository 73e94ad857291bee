"""`iprt calibrate`: a table for the device, from pictures of a few pixels."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from iprt import cli
from iprt.device.choose import choose_device
from iprt.measure import bench, calibration
from iprt.measure.tradeoff import Tradeoff, shipped
from iprt.measure.tradeoff_cache import TimedDevice, tradeoff_for
from iprt.settings.ladder import LADDER
from tests.measure.tiny import write_tiny

DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Few frames of few pixels, kept in a folder of the test; a scene of two views with truth."""
    monkeypatch.setattr(calibration, "SIDES", (8, 16))
    monkeypatch.setattr(calibration, "ROUNDS", 1)
    monkeypatch.setattr(calibration, "SSIM_FRAMES", (1, 2))
    monkeypatch.setattr(bench, "WARM_UP", 1)
    monkeypatch.setattr(bench, "FEWEST_ROUNDS", 1)
    monkeypatch.setattr("iprt.measure.tradeoff_cache.own_folder", lambda: tmp_path / "own")
    return write_tiny(tmp_path / "room", "near", "again", "third")


@pytest.mark.thorough
def test_a_table_of_the_device_is_kept_and_used(
    quick: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["calibrate", str(quick), "--device", DEVICE]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in LADDER)
    timed = TimedDevice.of(choose_device(DEVICE))
    table = tradeoff_for(timed)
    assert timed.made(table)
    assert (table.scene, table.truth) == ("box", shipped().truth)
    for mine, known in zip(table.entries, shipped().entries, strict=True):
        assert mine.ssim == known.ssim
        assert mine.seconds.keys() == {"near", "again"}
        assert mine.seconds_of(256).mean > 0.0


@pytest.mark.thorough
def test_a_table_with_the_accuracy_of_the_scene(quick: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.toml"
    words = ["calibrate", quick, "--view", "near", "--ssim", "-o", output, "--device", DEVICE]
    assert cli.main([str(word) for word in words]) == 0
    table = Tradeoff.read(output)
    assert (table.frames, table.truth) == ([1, 2], "box")
    for entry in table.entries:
        assert entry.seconds.keys() == entry.ssim.keys() == {"near"}
        # The truth is black and the picture is not.
        assert all(value < 0.5 for value in entry.ssim["near"])
    assert not (tmp_path / "own").exists()


def test_what_cannot_be_measured(quick: Path, fails: Callable[..., str], tmp_path: Path) -> None:
    assert "no view is named 'up'" in fails("calibrate", quick, "--view", "up", "--device", DEVICE)
    assert "is a folder" in fails("calibrate", quick, "-o", tmp_path)
    assert "scene.toml" in fails("calibrate", tmp_path / "nowhere")
    manifest = quick / "scene.toml"
    manifest.write_text(manifest.read_text().replace("truth", "# truth"))
    line = fails("calibrate", quick, "--ssim")
    assert "no view has a truth to compare with" in line
