"""The README and the docs keep their promises: commands, files, links, the table of kernels."""

from __future__ import annotations

import functools
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from iprt import cli
from tests import kernel_table
from tests.waiting import DEADLINE_S

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
METHOD_PAGES = sorted(ROOT.glob("iprt/methods/*/*.md"))


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


def commands(block: str) -> list[tuple[list[str], list[str]]]:
    """The words of each command, comments left out, and the lines that the page says it prints."""
    prompt = "$ " if block.startswith("$ ") else ""
    found: list[tuple[list[str], list[str]]] = []
    for line in block.replace("\\\n", " ").splitlines():
        if line.startswith(prompt):
            found.append((shlex.split(line.removeprefix(prompt), comments=True), []))
        else:
            found[-1][1].append(line)
    return [(words, printed) for words, printed in found if words]


def command_blocks(page: Path) -> list[list[tuple[list[str], list[str]]]]:
    return [commands(block) for block in blocks(page, "(?:bash|console)")]


def redirected(words: list[str]) -> tuple[list[str], Path | None]:
    """A command without `> FILE`, and that file."""
    if ">" not in words:
        return words, None
    *words, _, file = words
    return words, Path(file)


COMMANDS = [words for page in PAGES for block in command_blocks(page) for words, _ in block]
SHELL = {"source", "pip", "python", "ffmpeg"}
"""Programs of others, besides `iprt` and files of this repository."""


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Verbs keep their signatures and do nothing but tell here that they were reached."""
    reached: list[str] = []
    load = cli._load

    def harmless(target: str) -> Callable[..., int | None]:
        verb = load(target)

        @functools.wraps(verb)
        def tell(*_: object, **__: object) -> int:
            reached.append(target)
            return 0

        return tell

    monkeypatch.setattr(cli, "_load", harmless)
    return reached


IPRT_COMMANDS = [redirected(words)[0][1:] for words in COMMANDS if words[0] == "iprt"]


@pytest.mark.parametrize("words", IPRT_COMMANDS, ids=" ".join)
def test_iprt_commands_parse(words: list[str], parsed: list[str]) -> None:
    assert cli.main(words) == 0
    assert len(parsed) == 1


def test_every_verb_is_shown() -> None:
    shown = [" ".join(words) + " " for words in IPRT_COMMANDS]
    for verb in cli.VERBS:
        assert any(line.startswith(verb + " ") for line in shown), verb


def test_run_commands_exist() -> None:
    cases = set(re.findall(r"^(\w+)\)$", (ROOT / "run").read_text(), re.MULTILINE))
    used = {words[1] for words in COMMANDS if words[0] == "./run"}
    assert {"demo", "test"} <= used <= cases
    others = {words[0] for words in COMMANDS} - {"iprt", "./run"} - SHELL
    assert all((ROOT / name).is_file() for name in others), others


def anchors(page: Path) -> set[str]:
    """Return the names by which GitHub links to the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize(
    "page", [*PAGES, *METHOD_PAGES], ids=lambda page: str(page.relative_to(ROOT))
)
def test_named_files_exist(page: Path) -> None:
    text = page.read_text()
    links = [link.partition("#") for link in re.findall(r"\]\(([^):]+)\)", text)]
    missing = [link for link, _, _ in links if not (page.parent / link).exists()]
    assert not missing
    targets = [(page.parent / link if link else page, name) for link, _, name in links if name]
    assert not [(target, name) for target, name in targets if name not in anchors(target)]
    named = set(re.findall(r"`((?:cl|docs|glsl|iprt|scenes360|tests)/[\w./]*)`", text))
    assert not sorted(name for name in named if not (ROOT / name).exists())


def test_every_kernel_is_in_the_table() -> None:
    text = kernel_table.PAGE.read_text()
    shown = text.partition(kernel_table.START)[2].partition(kernel_table.END)[0].strip()
    assert shown == kernel_table.table(), "run python -m tests.kernel_table --write"
    left = " ".join(line.split("|")[1] for line in shown.splitlines())
    kernels = {str(path.relative_to(ROOT)) for path in (ROOT / "cl").rglob("*.cl")}
    assert kernels <= set(re.findall(r"`([\w./]+)`", left))


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 160


SIZE = ("--size", "64", "64")
SMALLER: dict[str, tuple[str, ...]] = {
    "render": (*SIZE, "--accumulate", "1"),
    "render scenes360/train": (*SIZE, "--accumulate", "1", "--frames", "0:1"),
    "render equirect": ("--size", "128", "64", "--accumulate", "1", "--frames", "0:1"),
    "compare": ("--accumulate", "1"),
    "compare --trails": ("--size", "56", "42", "--accumulate", "2", "--frames", "0:6"),
    "bench": (*SIZE, "--repeat", "1"),
    "bench-video": ("--size", "64", "32", "--repeat", "2"),
    "sweep": (*SIZE, "--view", "table", "--accumulate", "1", "--seeds", "1"),
    "converge": (*SIZE, "--accumulate", "1,2", "--seeds", "1"),
    "race": (*SIZE, "--accumulate", "1,2", "--seeds", "1"),
    "profile": (*SIZE, "--repeat", "1"),
    "reference": (*SIZE, "--spp", "1"),
}
"""Flags that are added to the pages' commands, so that they take less time. Later flags win. Sizes
divide those of the truths."""
FEWER_FRAMES = {
    "iprt.measure.bench.WARM_UP": 2,
    "iprt.measure.sweep.LEAST_TIMED": 8,
}
"""Numbers of frames that are timed, which no flag lowers; nobody reads the times here."""
NOT_HERE = {
    "iprt view": "waits for a user; tests/viewer/screen/ opens it",
    "./run": "sets up what is there already; .ci/run begins with it, word for word",
    ".ci/run": "runs these tests",
    "iprt compare scenes360/room --view table --method all": "takes each method; "
    "tests/measure/test_compare.py names some",
    "iprt calibrate": "takes two minutes; tests/commands/test_calibrate.py runs it on few pixels",
    "iprt equal-time": "takes each method; tests/measure/test_equal_time.py runs it on few pixels",
    "iprt claims": "takes each method; tests/measure/test_claims.py runs it on few pixels",
    "docs/measure.py": "takes fifteen minutes; tests/test_docs.py checks its commands",
    "source": "the tests' environment is active",
    "pip install": "the tests' environment is complete, or the commands that need it are left out",
}


def is_here(command: str) -> bool:
    if command.startswith(("iprt reference", "iprt race")):
        return find_spec("mitsuba") is not None
    if command.startswith("iprt export"):
        return find_spec("pxr") is not None
    return not any(command.startswith(start) for start in NOT_HERE)


SHRUNK = 4
PARTS = [
    *(
        pytest.param([block], SHRUNK, id=f"{page.stem}-{block[0][0][1]}")
        for page in (ROOT / "README.md", ROOT / "docs" / "guide.md")
        for block in command_blocks(page)
        if any(is_here(" ".join(words)) for words, _ in block)
    ),
    pytest.param(command_blocks(ROOT / "docs" / "meshes.md"), SHRUNK, id="meshes.md"),
    pytest.param(command_blocks(ROOT / "docs" / "lights.md"), SHRUNK, id="lights.md"),
    pytest.param(command_blocks(ROOT / "docs" / "footage.md"), 1, id="footage.md"),
]
"""Commands that run together: a block of the README or the guide, or another page as a whole. The
number is the step between kept rows and columns of the scene. Pages may state the output."""


@pytest.fixture(scope="module")
def clone(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a clone's scenes; what is found out about them is found out once."""
    folder = tmp_path_factory.mktemp("clone")
    shutil.copytree(ROOT / "scenes360", folder / "scenes360")
    if request.param > 1:
        shrink(folder / "scenes360" / "room", request.param)
    return folder


@pytest.mark.gl
@pytest.mark.thorough
@pytest.mark.parametrize(("blocks", "clone"), PARTS, indirect=["clone"])
def test_commands_run_as_they_are_written(
    blocks: list[list[tuple[list[str], list[str]]]],
    clone: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """They run in order."""
    monkeypatch.chdir(clone)
    shutil.rmtree("out", ignore_errors=True)
    Path("out").mkdir()  # by ./run demo
    for fewer_frames, count in FEWER_FRAMES.items():
        monkeypatch.setattr(fewer_frames, count)
    for block in blocks:
        for words, output in block:
            command = " ".join(words)
            if words[0] == "ffmpeg" and shutil.which("ffmpeg") is None:
                break  # what follows in the block uses its file
            if is_here(command):
                run(words, output, capsys)


def shrink(scene: Path, step: int) -> None:
    """Keep every `step`-th row and column of a scene's pictures, and of its views."""
    for path in scene.rglob("*.exr"):
        with OpenEXR.File(str(path)) as file:
            small = {
                name: np.ascontiguousarray(channel.pixels[::step, ::step])
                for name, channel in file.parts[0].channels.items()
            }
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, small).write(str(path))

    def scaled(match: re.Match[str]) -> str:
        return re.sub(r"\d+", lambda number: str(int(number[0]) // step), match[0])

    manifest = scene / "scene.toml"
    text = manifest.read_text()
    manifest.write_text(re.sub(r"^(size|cuts) = .*$", scaled, text, flags=re.MULTILINE))


def run(words: list[str], output: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Run one command of a page in the current folder; check its output and files."""
    command = " ".join(words)
    words, file = redirected(words)
    if words[0] != "iprt":
        subprocess.run(words, check=True, timeout=DEADLINE_S)
        return
    flags = [flag for start, flag in SMALLER.items() if set(start.split()) <= set(words)]
    capsys.readouterr()
    assert cli.main([*words[1:], *(flags[-1] if flags else ())]) == 0, command
    printed = capsys.readouterr().out
    assert set(output) <= set(printed.splitlines()), command
    if file is not None:
        file.write_text(printed)
    for flag, value in pairwise(words):
        if flag in ("-o", "--save", "--html", "--trace", "--thumbnail"):
            assert list(Path().glob(re.sub(r"%\d*d", "*", value))), command
