"""The command line: verbs, exit codes, one-line errors, quick start."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from iprt import cli
from iprt.commands.help import unwrapped
from iprt.errors import DeviceError, KernelError, SceneError
from tests.waiting import DEADLINE_S

ROOT = Path(__file__).parents[2]
Install = Callable[[Callable[..., int | None]], None]


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Install:
    """Make a function the only verb, as `iprt try-it` and `iprt scene look`."""

    def replace(function: Callable[..., int | None]) -> None:
        monkeypatch.setattr(cli, "VERBS", {"try-it": "m:f", "scene look": "m:f"})
        monkeypatch.setattr(cli, "_load", lambda _: function)

    return replace


def raising(error: BaseException) -> Callable[[], int]:
    def verb() -> int:
        """Fail."""
        raise error

    return verb


def test_every_verb_loads_and_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    for words in cli.VERBS:
        with pytest.raises(SystemExit) as caught:
            cli.main([*words.split(), "--help"])
        assert caught.value.code == 0
        text = capsys.readouterr().out
        assert f"usage: iprt {words} " in text
        assert "None" not in text, "no value is explained in words"
        assert "(default: )" not in text


def test_words_of_one_and_two_parts_reach_the_function(install: Install) -> None:
    seen = []

    def verb(*, count: int = 1) -> None:
        """Count."""
        seen.append(count)

    install(verb)
    assert cli.main(["try-it", "--count", "3"]) == 0
    assert cli.main(["scene", "look"]) == 0
    assert seen == [3, 1]


@pytest.mark.parametrize("code", [0, 1, 3])
def test_the_verbs_code_is_the_exit_code(install: Install, code: int) -> None:
    install(lambda: code)
    assert cli.main(["try-it"]) == code


NOTED = SceneError("bad")
NOTED.add_note("3 of 6 are finished")


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (SceneError("room/scene.toml: no 'depth'"), 2, "room/scene.toml: no 'depth'"),
        (DeviceError("none"), 3, "none"),
        (
            KernelError("cl/a.cl failed\n  device   a device\nx"),
            3,
            "cl/a.cl failed\n  device   a device\nx",
        ),
        (NOTED, 2, "bad; 3 of 6 are finished"),
    ],
    ids=["input", "device", "lines of compilers", "note"],
)
def test_errors_of_the_user_end_without_a_traceback(
    install: Install, capsys: pytest.CaptureFixture[str], error: Exception, code: int, told: str
) -> None:
    install(raising(error))
    assert cli.main(["try-it"]) == code
    captured = capsys.readouterr()
    assert captured.err == f"iprt: error: {told}\n"
    assert captured.out == ""


@pytest.mark.parametrize("arguments", [["--debug", "try-it"], ["try-it", "--debug"]])
def test_debug_shows_the_traceback(
    install: Install, capsys: pytest.CaptureFixture[str], arguments: list[str]
) -> None:
    install(raising(SceneError("bad")))
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert "Traceback" in captured.err
    assert captured.err.endswith("iprt: error: bad\n")


def test_a_defect_is_told_from_bad_input(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install(raising(ZeroDivisionError("division by zero")))
    assert cli.main(["try-it"]) == 70
    assert "ZeroDivisionError" in capsys.readouterr().err


@pytest.mark.parametrize("lines", [3, 100000])
@pytest.mark.parametrize("code", [0, 1])
def test_a_reader_that_leaves_changes_no_exit_code(lines: int, code: int) -> None:
    """Whether the pipe breaks within the verb or when the last lines are flushed."""
    program = (
        "import sys; from iprt import cli\n"
        "def verb():\n"
        " '''Talk.'''\n"
        " print('first', flush=True); sys.stdin.readline()\n"
        f" for _ in range({lines}): print('much')\n"
        f" return {code}\n"
        "cli.VERBS = {'talk': 'm:f', 'other': 'm:f'}; cli._load = lambda _: verb\n"
        "cli.command(['talk'])"
    )
    child = subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert child.stdin is not None
    assert child.stdout is not None
    assert child.stderr is not None
    child.stdout.readline()
    child.stdout.close()
    child.stdin.close()
    assert child.stderr.read() == b""
    assert child.wait() == code
    child.stderr.close()


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["rendr"],
        ["scene"],
        ["try-it", "--unknown"],
        ["try-it", "--count", "many"],
        ["try-it", "--count"],
    ],
)
def test_bad_usage_exits_with_2(install: Install, arguments: list[str]) -> None:
    def verb(*, count: int = 1) -> None:
        """Count."""
        pytest.fail("the verb ran")

    install(verb)
    with pytest.raises(SystemExit) as caught:
        cli.main(arguments)
    assert caught.value.code == 2


def test_the_list_is_brief_and_the_verbs_help_is_not(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    def verb() -> None:
        """First line.

        More to say.
        """

    install(verb)
    for arguments, told in (["--help"], False), (["try-it", "--help"], True):
        with pytest.raises(SystemExit) as caught:
            cli.main(arguments)
        text = capsys.readouterr().out
        assert caught.value.code == 0
        assert "First line." in text
        assert ("More to say." in text) == told


def test_help_texts_wrap_anew() -> None:
    text = "First.\n\nParameters\n---\na\n    One\n    two.\nb\n    Three."
    assert unwrapped(text) == "First.\n\nParameters\n---\na\n    One two.\nb\n    Three."


def test_a_limit_of_memory_may_be_why_there_is_no_device(
    monkeypatch: pytest.MonkeyPatch, fails: Callable[..., str], scene: Path
) -> None:
    words = ("scene", "check", scene, "--device", "cpu")
    monkeypatch.setattr("pyopencl.get_platforms", list)
    assert "ulimit" not in fails(*words, code=3)
    monkeypatch.setattr("resource.getrlimit", lambda _: (600 * 2**20, 2**40))
    assert "or raise `ulimit -v`: drivers may need more than the 600" in fails(*words, code=3)


def test_a_missing_device_is_one_line_and_exit_code_3(tmp_path: Path) -> None:
    """End to end, with a loader that finds no driver."""
    (tmp_path / "none.icd").write_text("libno-such-driver.so\n")
    code = "from iprt.device.choose import choose_device as c; import iprt.cli as i, sys\n" + (
        "def verb():\n '''Choose.'''\n c()\n"
        "i.VERBS = {'go': 'm:f', 'other': 'm:f'}; i._load = lambda _: verb\n"
        "sys.exit(i.main(['go']))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "OCL_ICD_VENDORS": str(tmp_path / "none.icd")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 3
    assert result.stderr.startswith("iprt: error: no OpenCL device: install a driver with `")
    assert f"; OCL_ICD_VENDORS={tmp_path / 'none.icd'} is set: drivers are" in result.stderr
    assert result.stderr.count("\n") == 1


def test_signals_are_handled_before_anything_heavy_is_imported() -> None:
    """Until `command` runs, a signal shows a traceback of whatever is being imported."""
    code = "import sys; from iprt.cli import command; print(*sys.modules)"
    result = subprocess.run(
        [sys.executable, "-S", "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    slow = {"typing", "importlib", "inspect", "logging", "pathlib", "subprocess", "tyro", "numpy"}
    assert not slow & set(result.stdout.split())


def test_help_starts_quickly() -> None:
    """Nothing heavy is imported to list the verbs."""
    code = (
        "import sys; from iprt import cli\n"
        "try: cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "print(*sorted(sys.modules), file=sys.stderr)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    heavy = {"pyopencl", "trimesh", "scipy", "skimage", "moderngl", "OpenEXR", "mitsuba"}
    assert not heavy & set(result.stderr.split())


@pytest.mark.thorough
def test_bash_completes_verbs_flags_and_values(tmp_path: Path) -> None:
    """By the script that docs/command-line.md says how to write."""
    script = tmp_path / "iprt"
    words = [sys.executable, "-m", "iprt", "--tyro-write-completion", "bash", str(script)]
    subprocess.run(words, check=True, timeout=DEADLINE_S)
    line = (
        f"source {script}; name=$(complete -p iprt | sed 's/.*-F \\([^ ]*\\).*/\\1/')\n"
        'try() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMPREPLY=()\n'
        'COMP_POINT=${#COMP_LINE}; $name iprt "${@: -1}" "${@: -2:1}"; echo "${COMPREPLY[*]}"; }\n'
        "try iprt swe; try iprt scene ch; try iprt render --qu; try iprt render --quality d"
    )
    done = subprocess.run(
        ["bash", "-c", line], capture_output=True, text=True, check=True, timeout=DEADLINE_S
    )
    assert done.stdout.split("\n")[:4] == ["sweep", "check", "--quality", "draft"]
