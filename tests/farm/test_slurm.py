"""`iprt farm slurm`: its script, run by a stand-in for SLURM."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest

from iprt.farm.slurm import script
from iprt.farm.submission import Submission
from iprt.files.lock import NAME, locked
from iprt.output.film_output import FilmOutput
from tests.conftest import DEVICE
from tests.farm.conftest import Program
from tests.farm.slurm import Slurm
from tests.scene.files import snapshot

SMALL = ("--chunk", "8", "--size", "24", "16", "--method", "ibl", "--accumulate", "2")
NAMES = ["plain", "two words", "it's", 'a "b" $HOME `c`', "ключ é 日本", "-x;y&z|#\\", "%j %a"]


def film(numbers: range, **changes: object) -> Submission:
    values = {
        "output": Path("/out/a.mp4"),
        "words": ["render", "/scene", "--output=/out/a.mp4"],
        "numbers": numbers,
        "chunk": 128,
        "gpus": 1,
        "target_s": 1200.0,
        "frame_s": None,
    }
    return Submission(**{**values, **changes})  # type: ignore[arg-type]


def run_script(text: str, slurm: Slurm, *words: str, shell: str = "sh") -> str:
    file = slurm.folder / "my job.sh"
    file.write_text(text)
    said = slurm.submit(file, *words, shell=shell)
    slurm.run()
    return said


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shell", ["sh", "bash"])
def test_every_chunk_is_rendered_once_whatever_the_names(
    name: str,
    shell: str,
    clip: Path,
    program: Program,
    tmp_path: Path,
    printed: Callable[..., str],
) -> None:
    scene, out = clip.rename(tmp_path / f"scene {name}"), tmp_path / f"out {name}"
    slurm = Slurm(tmp_path / "slurm")
    text = printed("farm", "slurm", scene, "-o", out / f"{name}.mp4", *SMALL)
    run_script(text, slurm, "--partition=gpu", shell=shell)
    *renders, join = program.calls
    assert join == ["join", f"{out}/{name}.mp4"]
    assert sorted(words[-1] for words in renders) == ["--chunks=0", "--chunks=1", "--chunks=2"]
    for words in renders:
        assert words[:2] == ["render", str(scene)]
        assert f"--output={out}/{name}.mp4" in words
        settings = f"{out}/{name}.mp4.parts/settings.toml"
        assert f"--settings={settings}" in words
        assert 'method = "ibl"' in Path(settings).read_text()
    for number in (100, 101):
        assert slurm.options(number)["--partition"] == "gpu"
    assert slurm.options(101)["--dependency"] == "afterany:100"
    assert "--array" not in slurm.options(101)


def test_arrays_are_as_short_as_slurm_wants_and_tasks_as_long_as_asked(
    program: Program, tmp_path: Path
) -> None:
    text = script(film(range(3, 2600)))
    slurm = Slurm(tmp_path / "slurm")
    run_script(text, slurm)
    assert slurm.options(100)["--array"] == "0-865"  # 2597 chunks in threes
    assert sum(_count(words) for words in program.calls[:-1]) == 2597
    assert {words[-1] for words in program.calls[:-1]} >= {"--chunks=3-5", "--chunks=2598-2599"}

    # 1200 s are 10 chunks of 128 frames; three times that, and 600 s to start, are the limit.
    timed = script(film(range(25), frame_s=0.9375), at_once=7)
    assert "#SBATCH --array=0-2%7\n" in timed
    assert "#SBATCH --time=70\n" in timed
    assert "#SBATCH --gres=gpu:1\n" in timed
    assert "    0-9 10-19 20-24\n" in timed
    assert "--time" not in text
    assert "--gres" not in script(film(range(3), gpus=0))


def _count(words: list[str]) -> int:
    first, _, last = words[-1].removeprefix("--chunks=").partition("-")
    return int(last or first) - int(first) + 1


@pytest.mark.parametrize(
    ("codes", "renders"),
    [((0, 0), 1), ((70, 0, 0), 2), ((3, 137, 0, 0), 3), ((70, 70, 70, 0), 3), ((2, 0), 1)],
)
def test_failures_are_tried_elsewhere_twice(
    codes: tuple[int, ...], renders: int, program: Program, tmp_path: Path
) -> None:
    program.ends_with(*codes)
    slurm = Slurm(tmp_path / "slurm")
    run_script(script(film(range(1))), slurm)
    assert [words[0] for words in program.calls] == ["render"] * renders + ["join"]
    assert slurm.ran[renders - 1].code == codes[renders - 1]


@pytest.mark.parametrize("kind", ["slurm", "openjd"])
def test_names_keep_their_bytes_whatever_stdout_is(kind: str, clip: Path, tmp_path: Path) -> None:
    words = ("-m", "iprt", "farm", kind, str(clip), "-o", str(tmp_path / "ключ é" / "a.mp4"))
    done = subprocess.run(
        [sys.executable, *words],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=True,
    )
    assert f"{tmp_path}/ключ é".encode() in done.stdout


def test_a_script_from_a_pipe_submits_nothing(program: Program, tmp_path: Path) -> None:
    slurm = Slurm(tmp_path / "slurm")
    result = subprocess.run(
        ["sh"],
        input=script(film(range(1))),
        env=slurm.environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == "save this script to a file, and run: sh FILE\n"
    assert not list(slurm.folder.glob("*.job"))


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="needs Debian's shellcheck")
@pytest.mark.parametrize("name", NAMES)
def test_shellcheck_has_nothing_to_say(name: str, tmp_path: Path) -> None:
    """Apart from notes on a $ or a backslash in single quotes, where they are right."""
    words = ["render", f"/{name}", f"--output=/o/{name}.mp4"]
    file = tmp_path / "job.sh"
    file.write_text(script(film(range(30), output=Path(f"/o/{name}.mp4"), words=words)))
    found = subprocess.run(
        ["shellcheck", "-Swarning", file], capture_output=True, text=True, check=False
    )
    assert found.stdout == ""


def test_finished_chunks_are_left_out(
    clip: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    printed: Callable[..., str],
    fails: Callable[..., str],
) -> None:
    order = ("farm", "slurm", clip, "-o", tmp_path / "out" / "f.%03d.exr", *SMALL)
    assert "    0 1 2\n" in printed(*order)
    missing = FilmOutput.missing
    monkeypatch.setattr(FilmOutput, "missing", lambda self, n: missing(self, n) if n != 1 else ())
    assert "    0 2\n" in printed(*order)
    monkeypatch.setattr(FilmOutput, "missing", lambda *_: ())
    assert "no frame is missing" in fails(*order)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("-o", "OUT/a.png"), "OUT/a.png: is a still picture; farms render films"),
        (("-o", "OUT/a.mp4", "--gpus", "-1"), "--gpus -1: expected 0 or more"),
        (("-o", "OUT/a.mp4", "--minutes", "0"), "--minutes 0: expected a number above 0"),
        (("-o", "OUT/a.mp4", "--seconds-per-frame", "nan"), "--seconds-per-frame nan: expected"),
        (("-o", "OUT/a.mp4", "--at-once", "0"), "--at-once 0: expected a number above 0"),
        (("-o", "OUT/a.mp4", "--chunk", "2"), "--chunk 2: expected at least 8"),
        (("-o", "OUT/a.mp4", "--view", "none"), "none"),
        (("-o", "OUT/a\nb/a.mp4"), r"OUT/a\nb/a.mp4.parts/settings.toml: has characters that"),
        (("-o", "OUT/\udcff.mp4"), r"\udcff.mp4.parts/settings.toml: has characters that"),
    ],
)
def test_bad_input_is_told_before_anything_is_written(
    words: tuple[str, ...], told: str, clip: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    given = [word.replace("OUT", str(tmp_path / "out")) for word in words]
    assert told.replace("OUT", str(tmp_path / "out")) in fails("farm", "slurm", clip, *given)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_one_process_renders_into_is_not_given_away(
    clip: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    with locked(tmp_path / "out"):
        line = fails("farm", "slurm", clip, "-o", tmp_path / "out" / "a.mp4", *SMALL)
        assert "renders into this folder" in line
        assert [path.name for path in (tmp_path / "out").iterdir()] == [NAME]


def test_parts_of_another_film_are_kept(
    clip: Path, tmp_path: Path, printed: Callable[..., str], fails: Callable[..., str]
) -> None:
    order = ("farm", "slurm", clip, "-o", tmp_path / "out" / "a.mp4", *SMALL)
    printed(*order)
    before = snapshot(tmp_path / "out")
    assert "another render: settings.seed was" in fails(*order, "--seed", "7")
    assert snapshot(tmp_path / "out") == before


@pytest.mark.thorough
def test_the_film_is_the_one_that_one_process_renders(
    clip: Path, tmp_path: Path, printed: Callable[..., str]
) -> None:
    """Two of three tasks are killed once."""
    order = (*SMALL, "--device", DEVICE)
    alone, out = tmp_path / "alone" / "a.mp4", tmp_path / "out" / "a.mp4"
    printed("render", clip, "-o", alone, *order)
    slurm = Slurm(tmp_path / "slurm", seed=5, kills=2)
    run_script(printed("farm", "slurm", clip, "-o", out, *order), slurm)
    assert len(slurm.ran) > 4
    assert sha256(out.read_bytes()).digest() == sha256(alone.read_bytes()).digest()
    assert [path.name for path in out.parent.iterdir()] == ["a.mp4"]
