"""What the README and docs promise: commands, Python example, files."""

from __future__ import annotations

import functools
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from iprt import cli

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


def command_lines() -> Iterator[list[str]]:
    """Words of every command in the pages' bash blocks, comments left out."""
    for page in PAGES:
        for block in blocks(page, "bash"):
            for line in block.splitlines():
                if words := shlex.split(line, comments=True):
                    yield words


COMMANDS = list(command_lines())


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


IPRT_COMMANDS = [words[1:] for words in COMMANDS if words[0] == "iprt"]


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
    others = {words[0] for words in COMMANDS} - {"iprt", "./run"}
    assert all((ROOT / name).is_file() for name in others), others


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_named_files_exist(page: Path) -> None:
    text = page.read_text()
    links = re.findall(r"\]\(([^)#:]+)\)", text)
    assert all((page.parent / link).exists() for link in links), links
    named = set(re.findall(r"`((?:cl|docs|glsl|iprt|scenes360|tests)/[\w./]*)`", text))
    missing = sorted(name for name in named if not (ROOT / name).exists())
    assert not missing


def test_every_kernel_is_in_the_table() -> None:
    table = (ROOT / "README.md").read_text().partition("| kernel | guarded by |")[2]
    left = " ".join(line.split("|")[1] for line in table.splitlines() if line.startswith("| `"))
    kernels = {f"cl/{path.name}" for path in (ROOT / "cl").glob("*.cl")}
    assert kernels <= set(re.findall(r"`([\w./]+)`", left))


@pytest.mark.gl
def test_python_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (example,) = blocks(ROOT / "README.md", "python")
    (tmp_path / "scenes360").symlink_to(ROOT / "scenes360")
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    assert (tmp_path / "out" / "table.png").stat().st_size > 1000
    assert re.search(r"^trace real +\d+\.\d\d ms per frame$", capsys.readouterr().out, re.MULTILINE)
