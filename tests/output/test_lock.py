"""One render at a time into a folder, and nothing left of the lock afterwards."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from iprt.errors import FormatError
from iprt.files.lock import NAME, locked

ROOT = Path(__file__).parents[2]


def assert_free(folder: Path) -> None:
    """The folder can be locked, and nothing is left of that."""
    before = set(folder.iterdir())
    with locked(folder):
        pass
    assert set(folder.iterdir()) == before - {folder / NAME}


def test_the_second_is_refused_and_told_who_holds_it(tmp_path: Path) -> None:
    link = tmp_path / "link"
    (tmp_path / "out").mkdir()
    link.symlink_to(tmp_path / "out")
    with locked(tmp_path / "out"):
        for name in (tmp_path / "out", link, tmp_path / "out" / ".." / "out"):
            with pytest.raises(FormatError) as caught, locked(name):
                pytest.fail("two hold it")
            assert str(caught.value).startswith(f"{name}: process {os.getpid()} on ")
            assert "\n" not in str(caught.value)
        assert_free(tmp_path)  # another folder
    assert_free(tmp_path / "out")


def test_it_is_freed_by_an_error(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), locked(tmp_path):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
    assert_free(tmp_path)


def test_a_killed_process_holds_nothing(tmp_path: Path) -> None:
    code = (
        "import os, signal; from pathlib import Path; from iprt.files.lock import locked\n"
        f"with locked(Path({str(tmp_path)!r})): os.kill(os.getpid(), signal.SIGKILL)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == -9
    assert (tmp_path / NAME).exists()
    assert_free(tmp_path)
    assert not (tmp_path / NAME).exists()


def test_missing_folders_are_made_and_removed_if_nothing_was_put_there(tmp_path: Path) -> None:
    with locked(tmp_path / "a" / "b"):
        assert (tmp_path / "a" / "b").is_dir()
    assert list(tmp_path.iterdir()) == []
    with locked(tmp_path / "a" / "b"):
        (tmp_path / "a" / "picture").touch()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["picture"]


def test_a_folder_removed_meanwhile_is_no_error(tmp_path: Path) -> None:
    with locked(tmp_path / "out"):
        shutil.rmtree(tmp_path / "out")
    with locked(tmp_path / "out"):
        shutil.rmtree(tmp_path / "out")
        (tmp_path / "out").touch()


def test_a_folder_that_cannot_be_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with (
        pytest.raises(FormatError, match=r"file/out: cannot be locked: "),
        locked(tmp_path / "file" / "out"),
    ):
        pytest.fail("a file is no folder")


def test_a_file_removed_between_opening_and_locking_is_not_believed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else one would lock a file without a name, and the next one a new file."""
    flock, calls = fcntl.flock, []

    def late(handle: int, flags: int) -> None:
        if not calls:
            (tmp_path / NAME).unlink()
        calls.append(handle)
        flock(handle, flags)

    monkeypatch.setattr(fcntl, "flock", late)
    with locked(tmp_path):
        assert len(calls) == 2
        with pytest.raises(FormatError), locked(tmp_path):
            pytest.fail("two hold it")


def test_without_locks_renders_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(handle: int, flags: int) -> None:
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", unknown)
    with locked(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_what_is_no_lock_is_neither_followed_nor_emptied(kind: str, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("a text")
    if kind == "link":
        (tmp_path / NAME).symlink_to("mine")
    elif kind == "pipe":
        os.mkfifo(tmp_path / NAME)
    else:
        (tmp_path / NAME).mkdir()
    with pytest.raises(FormatError, match=r"\.iprt\.lock: is not a file"), locked(tmp_path):
        pytest.fail("it is held")
    assert (tmp_path / "mine").read_text() == "a text"
    assert (tmp_path / NAME).exists()


def test_chunks_share_a_folder_and_exclude_a_whole_film(tmp_path: Path) -> None:
    def refused() -> None:
        with pytest.raises(FormatError, match="renders into this folder"), locked(tmp_path):
            pytest.fail("chunks of a film are rendered")

    with locked(tmp_path, shared=True):
        with locked(tmp_path, shared=True):
            refused()
        assert (tmp_path / NAME).exists(), "one still holds it"
        refused()
    assert list(tmp_path.iterdir()) == []
    with locked(tmp_path), pytest.raises(FormatError), locked(tmp_path, shared=True):
        pytest.fail("a film is joined")
