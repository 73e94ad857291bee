"""`iprt remote` controls viewers that `iprt view` started."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import iprt
from iprt.scene.scene import Scene
from iprt.viewer.program.running import folder
from tests.clips import write_clip
from tests.conftest import DEVICE
from tests.scene.files import CUBE
from tests.waiting import DEADLINE_S, run_python


@pytest.fixture(autouse=True)
def _own_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def started(scene: Path) -> subprocess.Popen[str]:
    """`iprt view --web`, once it can be reached."""
    words = ["view", str(scene), "--web", "--port", "0", "--quality", "draft", "--device", DEVICE]
    process = subprocess.Popen(
        [sys.executable, "-m", "iprt", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline().startswith("open http://localhost:")
    return process


@pytest.fixture
def viewer(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    process = started(write_clip(tmp_path / "clip", 1))
    yield process
    process.kill()
    process.communicate(timeout=DEADLINE_S)


def remote(*words: str, code: int = 0) -> str:
    """What `iprt remote` prints, or its complaint."""
    done = run_python("-m", "iprt", "remote", *words)
    assert done.returncode == code, done.stderr
    if code == 0:
        assert done.stderr == ""
        return done.stdout
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    return done.stderr.removeprefix("iprt: error: ").removesuffix("\n")


def test_a_shell_controls_a_viewer(viewer: subprocess.Popen[str], tmp_path: Path) -> None:
    mesh, png = tmp_path / "block.obj", tmp_path / "a.png"
    mesh.write_text(CUBE)
    assert remote("load", str(mesh), "--yaw", "20", "--pitch", "-40") == "block\n"
    remote("place", "block", "--position", "0.4", "-1", "-1.5", "--size", "0.4")
    remote("set", "trace.rays=2", "seed=3")
    remote("look", "--yaw", "10", "--pitch", "-30", "--fov", "70")
    status = json.loads(remote("status"))
    assert status["objects"]["block"]["position"] == [0.4, -1.0, -1.5]
    assert status["view"]["yaw"] == 10.0
    remote("render", str(png), "--size", "48", "32", "--frames", "2")
    with Image.open(png) as image:
        assert image.size == (48, 32)
        assert json.loads(image.info["iprt:settings"])["trace"]["rays"] == 2
        assert np.array(image).std() > 5.0
    assert "yaw: expected less than or equal to 360" in remote("look", "--yaw", "999", code=2)
    assert "no view is named 'x'" in remote("look", "x", code=2)
    assert "no setting 'trace.x'" in remote("set", "trace.x=1", code=2)
    assert "no object is named 'pot'" in remote("place", "pot", "--size", "1", code=2)
    assert "a.gif: unknown output format" in remote("render", "a.gif", code=2)
    assert "none.obj: no such file" in remote("load", "none.obj", code=2)
    assert "edits are not saved: block" in remote("quit", code=2)
    remote("save")
    assert [entry.name for entry in Scene.open(tmp_path / "clip").objects] == ["cube", "block"]
    remote("quit")
    assert viewer.wait(DEADLINE_S) == 0
    assert list(folder().iterdir()) == []
    assert "no viewer is running" in remote("status", code=2)


def test_a_killed_viewer_does_not_hide_the_next(
    viewer: subprocess.Popen[str], tmp_path: Path
) -> None:
    viewer.send_signal(signal.SIGKILL)
    viewer.wait(DEADLINE_S)
    assert len(list(folder().iterdir())) == 1
    other = started(write_clip(tmp_path / "other", 1))
    try:
        assert iprt.connect_viewer().status()["folder"] == str(tmp_path / "other")
        other.send_signal(signal.SIGTERM)
        assert other.wait(DEADLINE_S) == 143
        assert list(folder().iterdir()) == []
    finally:
        other.kill()
        other.communicate(timeout=DEADLINE_S)


def test_unsaved_edits_outlive_a_signal(viewer: subprocess.Popen[str], tmp_path: Path) -> None:
    """The line that ends the viewer says so, and the next one has them."""
    (tmp_path / "thing.obj").write_text(CUBE)
    assert remote("load", str(tmp_path / "thing.obj"), "--pitch", "-40") == "thing\n"
    viewer.send_signal(signal.SIGTERM)
    _, errors = viewer.communicate(timeout=DEADLINE_S)
    told = "unsaved edits are kept, and offered at the next start: thing"
    assert errors == f"iprt: terminated by SIGTERM; {told}\n"
    with iprt.view(tmp_path / "clip", device=DEVICE) as again:
        assert again.restore() == ["thing"]
        assert again.restore() == []
        assert again.status()["unsaved"] == ["thing"]
        again.undo()
        assert again.discard() == []
    assert sorted(path.name for path in (tmp_path / "clip").glob(".iprt*")) == []
