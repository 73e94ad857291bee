"""Films with real kernels: where and when a frame is rendered changes no byte of it."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import pytest

from iprt import cli
from tests.clips import write_clip
from tests.commands.test_faults import DEVICE, child_of
from tests.waiting import DEADLINE_S, until

FRAMES = 24
KILLED_AT = 13
FLAGS = ["--accumulate", "2", "--chunk", "10", "--device", DEVICE]
"""Three chunks, each with a warm-up of 8 frames."""
FLAGS += ["--set", "iprt.ratio_rows=16", "--set", "irradiance.rows=32"]


def words(scene: Path, output: Path) -> list[str]:
    return ["render", str(scene), "-o", str(output), *FLAGS]


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of each file of a folder."""
    return {path.name: sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_clip(tmp_path_factory.mktemp("resume") / "clip", FRAMES, size=(32, 24))


@pytest.fixture(scope="module")
def whole(clip: Path) -> dict[str, str]:
    """Digests of the frames of an uninterrupted render."""
    assert cli.main(words(clip, clip.parent / "whole" / "%02d.exr")) == 0
    return digests(clip.parent / "whole")


def test_chunks_apart_are_those_of_one_render(clip: Path, whole: dict[str, str]) -> None:
    output = clip.parent / "apart" / "%02d.exr"
    for number in (2, 0, 1):
        assert cli.main([*words(clip, output), "--chunks", str(number)]) == 0
    assert cli.main(["join", str(output)]) == 0
    assert digests(output.parent) == whole
    part = clip.parent / "part" / "%02d.exr"
    assert cli.main([*words(clip, part), "--frames", "5:9"]) == 0
    assert digests(part.parent) == {f"{i:02d}.exr": whole[f"{i:02d}.exr"] for i in range(5, 10)}


@pytest.mark.thorough
def test_a_killed_render_goes_on_as_if_nothing_had_happened(
    clip: Path, whole: dict[str, str]
) -> None:
    out = clip.parent / "out"
    code = (
        "import threading; from iprt import cli; from iprt.output.film_output import FilmOutput\n"
        "write = FilmOutput.write\n"
        "def stopping(self, number, index, *rest):\n"
        f"    threading.Event().wait() if index == {KILLED_AT} and number == 1 else "
        "write(self, number, index, *rest)\n"
        "FilmOutput.write = stopping\n"
        f"cli.command({words(clip, out / '%02d.exr')!r})"
    )
    reached = out / f"{KILLED_AT - 1:02d}.exr"
    with child_of(code) as child:
        until(lambda: reached.exists() or child.poll() is not None)
        child.kill()
        child.wait(timeout=DEADLINE_S)
    times = {path.name: path.stat().st_mtime_ns for path in out.glob("*.exr")}
    assert times, "killed in the middle"
    assert cli.main(words(clip, out / "%02d.exr")) == 0
    assert digests(out) == whole
    assert all((out / name).stat().st_mtime_ns == then for name, then in times.items())
