"""`iprt farm openjd`: its template, checked and run by the command of Open Job Description."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.conftest import DEVICE
from tests.farm.conftest import Program
from tests.waiting import DEADLINE_S

if not find_spec("openjd"):
    pytest.skip("needs the extra `test`: openjd-cli", allow_module_level=True)

SMALL = ("--chunk", "8", "--size", "24", "16", "--method", "ibl", "--accumulate", "2")


def openjd(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [Path(sys.executable).with_name("openjd"), *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=DEADLINE_S,
    )


@pytest.fixture
def template(tmp_path: Path, printed: Callable[..., str]) -> Callable[..., Path]:
    """A template in a file, which `openjd check` has found valid."""

    def write(*words: object) -> Path:
        file = tmp_path / "job.yaml"
        file.write_text(printed("farm", "openjd", *words), "utf-8")
        found = openjd("check", file)
        assert found.returncode == 0, found.stdout
        return file

    return write


@pytest.mark.parametrize("name", ['it\'s "two" words', "ключ é {x} #: \\n %j", "- [a]"])
def test_every_chunk_is_rendered_once_and_the_join_is_last(
    name: str, clip: Path, program: Program, tmp_path: Path, template: Callable[..., Path]
) -> None:
    """The job runs where the folders have another place than where it was made."""
    out = tmp_path / f"out {name}"
    file = template(clip, "-o", out / f"{name}.mp4", *SMALL)
    moved = clip.rename(tmp_path / f"scene {name}")
    mapped = out.rename(tmp_path / f"mapped {name}")
    done = openjd("run", file, "-p", f"Scene={moved}", "-p", f"Folder={mapped}")
    assert done.returncode == 0, done.stdout
    *renders, join = program.calls
    assert join == ["join", f"{mapped}/{name}.mp4"]
    chunks = [words[-2].removeprefix("--chunks=").partition("-") for words in renders]
    rendered = [n for a, _, b in chunks for n in range(int(a), int(b) + 1)]
    assert rendered == [0, 1, 2]
    for words in renders:
        assert words[:2] == ["render", str(moved)]
        assert f"--output={mapped}/{name}.mp4" in words
        settings = f"{mapped}/{name}.mp4.parts/settings.toml"
        assert f"--settings={settings}" in words
        assert 'method = "ibl"' in Path(settings).read_text()
        assert words[-1] == "--progress=openjd"


@pytest.mark.parametrize(
    ("codes", "calls", "code"), [((70, 0), 5, 0), ((70, 3), 2, 1), ((2, 0), 1, 1)]
)
def test_failures_are_tried_once_more(
    codes: tuple[int, ...],
    calls: int,
    code: int,
    clip: Path,
    program: Program,
    tmp_path: Path,
    template: Callable[..., Path],
) -> None:
    program.ends_with(*codes)
    file = template(clip, "-o", tmp_path / "out" / "a.mp4", *SMALL, "--minutes", "0.001")
    done = openjd("run", file, "-p", f"Scene={clip}", "-p", f"Folder={tmp_path / 'out'}")
    assert (done.returncode, len(program.calls)) == (code, calls), done.stdout
    told = f"openjd_fail: iprt failed with exit code {codes[calls - 1]}" if code else "status: fail"
    assert told in done.stdout


def test_tasks_take_what_they_need(
    clip: Path, program: Program, tmp_path: Path, template: Callable[..., Path]
) -> None:
    order = (clip, "-o", tmp_path / "out" / "a.mp4", *SMALL)
    text = template(*order).read_text()
    assert "defaultTaskCount: 1\n        targetRuntimeSeconds: 1200\n" in text
    assert "- name: amount.worker.gpu\n      min: 1\n" in text
    # A chunk has 8 frames and 8 of a warm-up; 64 s are two.
    text = template(*order, "--minutes", "1.07", "--seconds-per-frame", "2").read_text()
    assert "defaultTaskCount: 2\n        targetRuntimeSeconds: 64\n" in text
    assert "amount.worker.gpu" not in template(*order, "--device", "cpu").read_text()
    assert "      min: 2\n" in template(*order, "--gpus", "2").read_text()


@pytest.mark.parametrize("name", ["a{{Param.Scene}}", "/".join(6 * ["b" * 200]), "a\nb"])
def test_names_that_templates_cannot_hold_are_told(
    name: str, clip: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    line = fails("farm", "openjd", clip, "-o", tmp_path / "out" / name / "a.mp4")
    assert "rename it" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
def test_the_film_is_the_one_that_one_process_renders(
    clip: Path, tmp_path: Path, template: Callable[..., Path], printed: Callable[..., str]
) -> None:
    order = (*SMALL, "--device", DEVICE)
    alone, out = tmp_path / "alone" / "a.mp4", tmp_path / "out" / "a.mp4"
    printed("render", clip, "-o", alone, *order)
    file = template(clip, "-o", out, *order)
    done = openjd("run", file, "-p", f"Scene={clip}", "-p", f"Folder={out.parent}")
    assert done.returncode == 0, done.stdout
    assert "openjd_progress: 50.0" in done.stdout
    assert sha256(out.read_bytes()).digest() == sha256(alone.read_bytes()).digest()
    assert [path.name for path in out.parent.iterdir()] == ["a.mp4"]
