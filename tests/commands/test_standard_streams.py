"""Whatever stdout and stderr lead to: an exit code, one line, and nothing lost or done twice."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from iprt import __version__
from iprt.cli import VERBS
from tests.scene.files import CUBE, snapshot
from tests.waiting import DEADLINE_S

ROOT = Path(__file__).parents[2]
IPRT = f"'{sys.executable}' -m iprt"
ARGUMENTS = {
    "doctor": "",
    "settings": "",
    "render": "SCENE -o OUT/a.png --method ibl --size 32 32 --accumulate 1",
    "reference": "SCENE -o OUT/a.exr",
    "export": "SCENE -o OUT/a.usda",
    "scene new": "OUT/new --color SCENE/color.exr --depth SCENE/depth.exr",
    "scene add": "SCENE OUT/m.obj --look 0 -40",
}
"""What a verb is given, where that is more than a scene."""


@pytest.fixture
def folder(scene: Path, tmp_path: Path) -> Path:
    """A folder with a scene `room` and a mesh `m.obj`."""
    assert scene == tmp_path / "room"
    (tmp_path / "m.obj").write_text(CUBE)
    return tmp_path


def shell(
    words: str, folder: Path, redirection: str = "", **environment: str
) -> subprocess.CompletedProcess[bytes]:
    """Run `iprt` by a shell, with the names of a scene and a folder put in."""
    line = words.replace("SCENE", f"'{folder}/room'").replace("OUT", f"'{folder}'")
    return subprocess.run(
        f"{IPRT} {line} {redirection}",
        shell=True,
        executable="/bin/bash",
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "", **environment},  # as users have it
        capture_output=True,
        check=False,
        timeout=DEADLINE_S,
    )


@pytest.mark.parametrize("verb", [*VERBS, "--help", "--version", "render --help", "rendr"])
@pytest.mark.parametrize("redirection", [">/dev/full", ">&-"])
def test_without_stdout_nothing_is_begun(verb: str, redirection: str, folder: Path) -> None:
    before = snapshot(folder)
    given = ARGUMENTS.get(verb, "SCENE" if verb in VERBS else "")
    result = shell(f"{verb} {given}", folder, redirection)
    assert result.returncode == 2
    assert result.stderr.startswith(b"iprt: error: stdout: cannot be written: ")
    assert result.stderr.count(b"\n") == 1
    assert snapshot(folder) == before


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("verb", "told"),
    [
        ("scene add", "m has been added to"),
        ("scene new", "new has been made"),
        ("render", "a.png has been written"),
        ("settings", ""),
    ],
)
def test_a_disk_that_is_full_at_the_end_tells_what_is_done(
    verb: str, told: str, folder: Path
) -> None:
    """A file that may not grow stands for the disk."""
    end = 2**30
    given = ARGUMENTS.get(verb, "SCENE").replace("SCENE", "room").replace("OUT/", "")
    with (folder / "log").open("wb") as log:
        log.seek(end)
        result = subprocess.run(
            [sys.executable, "-m", "iprt", *verb.split(), *given.split()],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": ""},
            stdout=log,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (end, end)),
            check=False,
        )
    assert result.returncode == 2, result.stderr
    lines = [line for line in result.stderr.splitlines() if "stdout" in line]
    assert len(lines) == 1
    assert lines[0].startswith("iprt: error: stdout: cannot be written: File too large")
    assert told in lines[0]
    assert "Traceback" not in result.stderr
    if verb == "scene add":
        assert (folder / "room" / "scene.toml").read_text().count('[[objects]]\nname = "m"') == 1
    if verb == "render":
        assert (folder / "a.png").is_file()


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("redirection", "words", "code", "out"),
    [
        ("2>&-", "settings", 0, b"# Settings of iprt"),
        ("2>/dev/full", "scene check SCENE --device none", 3, b""),
        ("<&- 2>&-", "render", 2, b""),
        ("2>/dev/full", "--debug settings --settings nowhere.toml", 2, b""),
        ("<&- 2>&-", "scene add SCENE OUT/m.obj --look 0 -40", 0, b"m: "),
    ],
)
def test_a_lost_stderr_changes_nothing(
    redirection: str, words: str, code: int, out: bytes, folder: Path
) -> None:
    result = shell(words, folder, redirection)
    assert result.returncode == code
    assert result.stdout.startswith(out)
    assert bool(result.stdout) == bool(out)
    assert result.stderr == b""


def test_files_do_not_get_the_number_of_a_closed_stream(folder: Path) -> None:
    """Else what a driver prints to stderr would end up in one of them."""
    program = (
        "import os, sys; from iprt.commands.standard_streams import prepare_streams\n"
        "prepare_streams()\n"
        "file = os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT)\n"
        "os.write(2, b'what a driver prints'); print(file > 2)"
    )
    result = subprocess.run(
        f"'{sys.executable}' -c \"{program}\" '{folder}/file' <&- 2>&-",
        shell=True,
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    assert result.stdout == b"True\n"
    assert (folder / "file").read_bytes() == b""


@pytest.mark.thorough
@pytest.mark.parametrize(("words", "code"), [("--help", 0), ("settings", 0), ("rendr", 2)])
def test_a_reader_that_leaves_is_no_error(words: str, code: int, folder: Path) -> None:
    """Also where only the last flush finds that out."""
    result = shell(words, folder, "| true; exit ${PIPESTATUS[0]}")
    assert result.returncode == code
    assert b"BrokenPipe" not in result.stderr
    assert b"Traceback" not in result.stderr


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "encoding"),
    [("--help", "latin-1"), ("settings", "latin-1"), ("render --help", "ascii")],
)
def test_characters_that_an_encoding_lacks_are_replaced(
    words: str, encoding: str, folder: Path
) -> None:
    result = shell(words, folder, PYTHONIOENCODING=encoding, PYTHONUTF8="0")
    assert result.returncode == 0, result.stderr
    result.stdout.decode(encoding)
    assert b"Error" not in result.stderr


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "columns"),
    [
        *(("render --help", columns) for columns in ("-1", "0", "1", "abc", "100000", "²")),
        ("render --size 1", "1"),
    ],
)
def test_any_width_of_the_terminal_will_do(columns: str, words: str, folder: Path) -> None:
    result = shell(words, folder, COLUMNS=columns)
    assert result.returncode == (2 if "--size" in words else 0), result.stderr
    assert b"Traceback" not in result.stderr
    lines = (result.stdout or result.stderr).decode().splitlines()
    assert max(map(len, lines)) >= 40


def test_the_version_is_one_line_wherever_it_is_asked_for(folder: Path) -> None:
    lines = {shell(words, folder).stdout for words in ("--version", "render SCENE --version")}
    assert len(lines) == 1
    (line,) = lines
    assert line.startswith(f"iprt {__version__}, Python 3.".encode())
    assert b", pyopencl 2" in line
    assert line.count(b"\n") == 1


@pytest.mark.thorough
def test_quiet_leaves_results_and_errors(folder: Path) -> None:
    """The render without OpenGL logs that rays draw the objects."""
    given = ARGUMENTS["render"]
    without = {"__EGL_VENDOR_LIBRARY_DIRS": str(folder / "none")}
    plain = shell(f"render {given}", folder, **without)
    path = f"{folder}/a.png\n".encode()
    assert (plain.returncode, plain.stdout) == (0, path)
    result = shell(f"render {given} -q", folder, **without)
    assert (result.returncode, result.stdout, result.stderr) == (0, path, b"")
    told = shell("--quiet render nowhere -o OUT/a.png", folder)
    assert told.returncode == 2
    assert told.stderr.startswith(b"iprt: error: nowhere")


@pytest.mark.thorough
def test_the_table_of_passes_is_shown_where_it_is_asked_for(folder: Path) -> None:
    result = shell(f"render {ARGUMENTS['render']} --verbose", folder)
    assert result.returncode == 0, result.stderr
    assert b"all passes" in result.stdout
    assert result.stdout.endswith(f"{folder}/a.png\n".encode())


def test_quiet_and_verbose_exclude_each_other(folder: Path) -> None:
    result = shell("settings --quiet --verbose", folder)
    assert result.returncode == 2
    assert result.stderr == b"iprt: error: --quiet and --verbose: give one of them\n"
    short = shell("settings -q -v", folder)
    assert short.stderr == b"iprt: error: -q and -v: give one of them\n"


def test_unbuffered_lines_are_not_held_back() -> None:
    program = (
        "import os; from iprt.commands.standard_streams import prepare_streams\n"
        "prepare_streams(); print('first'); os._exit(0)"
    )
    words = [sys.executable, "-u", "-c", program]
    result = subprocess.run(words, cwd=ROOT, capture_output=True, check=False)
    assert result.stdout == b"first\n"
