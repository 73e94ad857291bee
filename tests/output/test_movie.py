"""Video files that grow: whatever ends a render, it goes on, and the file is the same."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import av
import pytest

from iprt.errors import FormatError
from iprt.output.encode import join_pieces
from iprt.output.parts import PLAN, SUFFIX
from tests.output.films import FRAMES, contents, opened, picture, plan, render, whole

ROOT = Path(__file__).parents[2]


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_parts_are_pieces_and_the_pictures_of_the_next(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    target = opened(path)
    for index in FRAMES:
        target.write(0, index, picture(index), "a device")
        # A piece is encoded once its three pictures are there.
        position = FRAMES.index(index)
        waiting = 0 if index == FRAMES[-1] else (position + 1) % 3
        assert len(list(target.parts.path.glob("*.npy"))) == waiting
    assert target.parts.path == tmp_path / "a.mp4.parts"
    assert not path.exists()
    target.finish()
    assert names(tmp_path) == {"a.mp4"}
    with av.open(str(path)) as container:
        shown = [frame.to_ndarray(format="rgb24")[8, 16, 2] for frame in container.decode(video=0)]
    assert len(shown) == len(FRAMES)
    assert all(later > sooner for sooner, later in pairwise(shown))


def written(path: Path) -> tuple[int, ...]:
    """Which file it is and when it was last written; reading it is no change."""
    stat = path.stat()
    return stat.st_ino, stat.st_size, stat.st_mtime_ns


def test_a_finished_file_is_left_alone(tmp_path: Path) -> None:
    path = whole(tmp_path / "a.mp4")
    before = written(path)
    target = opened(path)
    assert (target.complete, target.missing(0), target.done) == (True, (), len(FRAMES))
    target.finish()
    assert written(path) == before
    assert names(tmp_path) == {"a.mp4"}


def test_a_file_of_other_settings_is_replaced_when_the_new_one_is_whole(tmp_path: Path) -> None:
    path = whole(tmp_path / "a.mp4")
    before = path.read_bytes()
    target = opened(path, plan(**{"iprt:seed": "7"}))
    assert len(target.missing(0)) == len(FRAMES)
    for index in FRAMES:
        assert path.read_bytes() == before
        target.write(0, index, picture(index), "a device")
    target.finish()
    assert path.read_bytes() != before


def test_parts_of_another_video_are_not_mixed_in(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    opened(path).write(0, 10, picture(10), "a device")
    with pytest.raises(FormatError) as caught:
        opened(path, plan(**{"iprt:seed": "7"}))
    assert str(caught.value) == (
        f"{path}.parts: holds finished frames of another render: seed was 0 then and is 7 now; "
        "delete this folder to start again, or name another output"
    )
    (tmp_path / "a.mp4.parts" / PLAN).unlink()
    with pytest.raises(FormatError, match=r"a\.mp4\.parts: was not made by iprt"):
        opened(path)
    (tmp_path / "a.mp4.parts" / PLAN).write_text("{}")
    with pytest.raises(FormatError, match=r"film\.json: cannot be read; delete the folder"):
        opened(path)


def test_what_a_killed_render_left_is_removed(tmp_path: Path) -> None:
    left = opened(tmp_path / "a.mp4").parts.path / f".{'0a' * 16}.tmp"
    left.write_bytes(b"half")
    opened(tmp_path / "a.mp4").clean()
    assert not left.exists()


def test_links_are_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "a.mp4").symlink_to(tmp_path / "there" / "b.mp4")
    with pytest.raises(FormatError, match=r"a\.mp4: is a symbolic link"):
        whole(tmp_path / "a.mp4")
    assert (tmp_path / "a.mp4").is_symlink()
    (tmp_path / "c.mp4.parts").symlink_to(tmp_path / "there")
    with pytest.raises(FormatError, match=r"c\.mp4\.parts: is a symbolic link"):
        opened(tmp_path / "c.mp4")
    assert names(tmp_path / "there") == set()


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_keeps_what_is_finished(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mp4"
    target = opened(path)
    target.write(0, 10, picture(10), "a device")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, call, full)
    with pytest.raises(FormatError, match="No space left"):
        target.write(0, 12, picture(12), "a device")
    monkeypatch.undo()
    assert names(target.parts.path) == {PLAN, "0000000.npy"}
    assert opened(path).missing(0) == tuple(FRAMES[1:])


FULL = """
import resource, sys
from pathlib import Path
from iprt.errors import FormatError
from tests.output import films

target = films.opened(Path(sys.argv[1]))
resource.setrlimit(resource.RLIMIT_FSIZE, (600, 600))  # a picture has 768 bytes and a header
try:
    target.write(0, 10, films.picture(10), "a device")
except FormatError as error:
    print(error)
"""


def test_a_disk_that_is_full_within_a_picture_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    done = subprocess.run(
        [sys.executable, "-c", FULL, path], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert "0000000.npy: cannot be written: File too large" in done.stdout, done.stderr
    assert opened(path).missing(0) == tuple(FRAMES)


def test_a_full_disk_at_the_end_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mp4"
    target = opened(path)
    render(target)

    def full(file: Path, *_: object, **__: object) -> None:
        join_pieces(file, *_, **__)
        raise FormatError(f"{file}: cannot be written: No space left on device")

    monkeypatch.setattr("iprt.output.movie.join_pieces", full)
    with pytest.raises(FormatError, match="No space left"):
        target.finish()
    monkeypatch.undo()
    again = opened(path)
    assert again.complete
    again.finish()
    assert path.read_bytes() == whole(tmp_path / "b.mp4").read_bytes()


# Killed at any moment ----------------------------------------------------------------------------

KILLED = """
import json, os, signal, sys
from pathlib import Path
from tests.output import films

folder, kind, chunk = Path(sys.argv[1]), sys.argv[2], int(sys.argv[4])

def render(path, log):
    path = path if kind == "movie" else path / kind
    target = films.opened(path, films.plan(chunk=chunk, warm_up=2))
    target.clean()
    write = target.write
    def logged(number, index, *rest):
        write(number, index, *rest)
        with log.open("a") as file:
            file.write(f"{number}:{index} ")
    target.write = logged
    films.render(target)
    target.finish()

calls = {"moments": 0, "last": None}
def watched(name, function):
    def call(*args, **kwargs):
        for _ in range(2):  # before and after
            calls["moments"] += 1
            if calls["moments"] == calls["last"]:
                os.kill(os.getpid(), signal.SIGKILL)
            if _ == 0:
                result = function(*args, **kwargs)
        return result
    return call
for name in ("replace", "unlink", "fsync", "rmdir", "mkdir"):
    setattr(os, name, watched(name, getattr(os, name)))

whole = folder / "whole.mp4"
render(whole, folder / "whole.log")
moments = calls["moments"]
log = folder / "log"
ends = []
for last in range(1, moments + 1, int(sys.argv[3])):
    path = folder / f"{last}.mp4"
    log = folder / f"{last}.log"
    child = os.fork()
    if child == 0:
        calls.update(moments=0, last=last)
        render(path, log)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    calls["last"] = None
    render(path, log)
    ends.append((os.WIFSIGNALED(status), log.read_text().split()))
print(json.dumps([moments, ends]))
"""


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("kind", "every", "chunk"),
    [("movie", 3, 120), ("movie", 4, 3), ("%d.png", 2, 120), ("%d.exr", 5, 3)],
)
def test_a_render_killed_at_any_moment_goes_on(
    kind: str, every: int, chunk: int, tmp_path: Path
) -> None:
    """The file is the same to the byte, and no finished frame was rendered again."""
    done = subprocess.run(
        [sys.executable, "-c", KILLED, tmp_path, kind, str(every), str(chunk)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    moments, ends = json.loads(done.stdout)
    assert moments > 4 * len(FRAMES)
    assert len(ends) == len(range(1, moments + 1, every))
    assert all(killed for killed, _ in ends)
    for _, rendered in ends:
        again = len(rendered) - len(set(rendered))
        assert {int(each.split(":")[1]) for each in rendered} <= set(FRAMES)
        assert again == 0
        assert len(rendered) >= len(FRAMES) - 1, "one may be written and not logged"
    expected = contents(tmp_path / "whole.mp4")
    assert len(expected) == (1 if kind == "movie" else len(FRAMES))
    for last in range(1, moments + 1, every):
        assert contents(tmp_path / f"{last}.mp4") == expected, last
    assert not list(tmp_path.rglob(f"*{SUFFIX}"))
