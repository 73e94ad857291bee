"""A program opens a viewer for browsers, and those who visit it see what the program does."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import iprt
from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.scene.scene import Scene
from iprt.viewer import requirements
from iprt.viewer.engine import Engine
from iprt.viewer.program.handle import Viewer, first_start
from iprt.viewer.viewport import Viewport
from iprt.viewer.web.host import Host
from tests.clips import write_clip
from tests.conftest import DEVICE
from tests.viewer.screen.browsing import DECODED, Visitor, browsing, until
from tests.viewer.screen.web import FRAMES, at_rest
from tests.viewer.turns import SETTINGS
from tests.waiting import DEADLINE_S, run_python


@pytest.fixture
def viewer(
    device: ComputeDevice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Viewer]:
    monkeypatch.setattr("iprt.viewer.web.browser.Viewport", partial(Viewport, frames=FRAMES))
    scene = Scene.open(write_clip(tmp_path / "clip", 4))
    engine = Engine(scene, lambda: device, SETTINGS)
    with Viewer(engine, Host(engine, first_start(scene), 0)) as viewer:
        yield viewer


def test_browsers_show_what_a_program_does(viewer: Viewer) -> None:
    with browsing() as visit:
        page = visit(viewer.url)
        (browser,) = viewer._host.browsers
        view = at_rest(page, browser)
        before = page.texture()
        viewer.place("cube", (0.6, -1.0, -1.6))
        at_rest_again(viewer, page)
        after = page.texture()
        assert np.abs(after.astype(int) - before).max() > 30
        size = (view.width, view.height)
        linear = viewer.picture(frames=FRAMES)  # in the window's size
        assert linear.shape[:2] == after.shape[:2] == size[::-1]
        viewer.look(yaw=40.0, pitch=-20.0, fov=50.0)
        viewer.display(exposure=-1.0)
        at_rest_again(viewer, page)
        assert page.looks()[3] == pytest.approx(50.0)
        assert browser.viewport.view.yaw_deg == pytest.approx(40.0)
        turned = page.texture()
        later = visit(viewer.url)
        second = viewer._host.browsers[-1]
        assert at_rest(later, second) == browser.viewport.view
        assert np.abs(later.texture().astype(int) - turned).mean() < 3.0  # of another noise
        viewer.look("ahead")
        viewer.show("cube", False)
        for one, other in ((page, browser), (later, second)):
            assert at_rest(one, other).pitch_deg == pytest.approx(-30.0)
            assert other.viewport.objects == ()


def at_rest_again(viewer: Viewer, page: Visitor) -> None:
    """Wait until the first browser shows all edits."""
    browser = viewer._host.browsers[0]
    number = viewer._engine._shared._world_number
    until(lambda: browser.displayed.shown.number >= number, "the edit is not shown")
    at_rest(page, browser)


def test_a_notebook_shows_it_in_a_frame(viewer: Viewer, tmp_path: Path) -> None:
    notebook = tmp_path / "notebook.html"
    notebook.write_text(f"<!doctype html><body>{viewer._repr_html_()}</body>")
    with browsing() as visit:
        page = visit(viewer.url).page
        page.goto(notebook.as_uri())
        until(lambda: page.frames[-1].url.startswith(viewer.url), "there is no frame")
        frame = page.frames[-1]
        frame.wait_for_function(DECODED, timeout=1000 * DEADLINE_S)
        text = page.locator("p").inner_text()
        port = viewer._host.port
        assert f"ssh -L {port}:localhost:{port} {socket.gethostname()}" in text
        assert f"The viewer is at http://localhost:{port}/ on the machine" in text
    assert repr(viewer) == f"<viewer of clip at http://localhost:{port}/>"


def test_several_viewers_of_a_scene(tmp_path: Path) -> None:
    folder = write_clip(tmp_path / "clip", 1)
    with (
        iprt.view(folder, settings=SETTINGS, device=DEVICE, yaw=20.0) as one,
        iprt.view(Scene.open(folder), settings=SETTINGS, device=DEVICE) as other,
    ):
        one.look("ahead")
        np.testing.assert_array_equal(
            one.picture((16, 8), frames=1), other.picture((16, 8), frames=1)
        )
        with pytest.raises(IprtError, match="Address already in use"):
            iprt.view(folder, device=DEVICE, port=one._host.port)
    for viewer in (one, other):
        assert (
            repr(viewer)
            == "<closed viewer of clip>"
            == viewer._repr_html_().replace("&lt;", "<").replace("&gt;", ">")
        )
        viewer.close()
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", viewer._host.port), DEADLINE_S)
        with pytest.raises(IprtError, match="the viewer was closed"):
            viewer.picture()


def test_a_viewer_that_nobody_closes_ends_with_the_process(tmp_path: Path) -> None:
    """Its edits are kept for the next one."""
    folder = write_clip(tmp_path / "clip", 3)
    lines = (
        "import iprt",
        f"viewer = iprt.view({str(folder)!r}, device={DEVICE!r})",
        "print(viewer.status()['scene'])",
        "viewer.remove('cube')",  # the video's thread has begun
    )
    done = run_python("-c", "\n".join(lines))
    told = "unsaved edits are kept, and offered at the next start: cube\n"
    assert (done.returncode, done.stdout, done.stderr) == (0, "clip\n", told)


def test_what_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(IprtError, match=r"scene\.toml"):
        iprt.view(tmp_path / "nowhere", device=DEVICE)
    folder = write_clip(tmp_path / "clip", 1)
    with pytest.raises(IprtError, match="no view is named 'behind'"):
        iprt.view(folder, "behind", device=DEVICE)
    monkeypatch.setattr(requirements, "BROWSER", ("no_viser",))
    with pytest.raises(IprtError, match=r"no_viser is not installed.*install the extra `view`"):
        iprt.view(folder, device=DEVICE)
