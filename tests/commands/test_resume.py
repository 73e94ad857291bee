"""A render of a video killed in the middle, with real kernels: it goes on without a jump."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt import cli
from iprt.files.images import read_color
from tests.clips import write_clip
from tests.commands.test_faults import DEVICE, child_of
from tests.waiting import DEADLINE_S, until

FRAMES = 10
KILLED_AT = 6
FLAGS = ["--accumulate", "1", "--device", DEVICE, "--set", "iprt.ratio_rows=16"]
FLAGS += ["--set", "irradiance.rows=32"]


def words(scene: Path, output: Path) -> list[str]:
    return ["render", str(scene), "-o", str(output), *FLAGS]


def pictures(folder: Path) -> NDArray[np.float32]:
    return np.stack([read_color(folder / f"{index:02d}.exr") for index in range(FRAMES)])


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_clip(tmp_path_factory.mktemp("resume") / "clip", FRAMES, size=(32, 24))


@pytest.fixture(scope="module")
def whole(clip: Path) -> NDArray[np.float32]:
    """The frames of an uninterrupted render."""
    assert cli.main(words(clip, clip.parent / "whole" / "%02d.exr")) == 0
    return pictures(clip.parent / "whole")


@pytest.mark.thorough
def test_a_killed_render_goes_on_without_a_jump(clip: Path, whole: NDArray[np.float32]) -> None:
    out = clip.parent / "out"
    code = (
        "import threading; from iprt import cli; from iprt.output.frames import PictureSequence\n"
        "write = PictureSequence.write\n"
        "def stopping(self, index, *rest):\n"
        f"    threading.Event().wait() if index == {KILLED_AT} else write(self, index, *rest)\n"
        "PictureSequence.write = stopping\n"
        f"cli.command({words(clip, out / '%02d.exr')!r})"
    )
    reached = out / f"{KILLED_AT - 1:02d}.exr"
    with child_of(code) as child:
        until(lambda: reached.exists() or child.poll() is not None)
        child.kill()
        child.wait(timeout=DEADLINE_S)
    times = {path.name: path.stat().st_mtime_ns for path in out.glob("*.exr")}
    assert KILLED_AT <= len(times) < FRAMES, "killed in the middle"
    assert cli.main(words(clip, out / "%02d.exr")) == 0
    assert len(list(out.iterdir())) == FRAMES, "and nothing else"
    assert all((out / name).stat().st_mtime_ns == then for name, then in times.items())
    resumed, first = pictures(out), len(times)
    assert np.array_equal(resumed[:first], whole[:first]), "those before the kill, bit for bit"
    seam = np.abs(resumed - whole)[first].mean()
    change = np.abs(whole[first] - whole[first - 1]).mean()
    assert seam < 0.12 * change
    assert np.abs(resumed[first] - resumed[first - 1]).mean() == pytest.approx(change, rel=0.05)
