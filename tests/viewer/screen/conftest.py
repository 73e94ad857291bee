"""A desktop viewer and one who sits before it; a viewer for browsers and those who visit it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from iprt.device.compute import ComputeDevice

if TYPE_CHECKING:
    from tests.viewer.screen.user import User
    from tests.viewer.screen.web import Place


FOLDER = Path(__file__).parent
# Without what they need, which `./run screen` installs, these are left out.
collect_ignore_glob = []
if not (find_spec("imgui_bundle") and find_spec("Xlib") and shutil.which("Xvfb")):
    collect_ignore_glob.append("test_desktop*")
if not find_spec("viser"):
    collect_ignore_glob.append("test_web*")


@pytest.hookimpl(tryfirst=True)  # before -m counts
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of this folder."""
    for item in items:
        if item.path.parent == FOLDER:
            item.add_marker("screen")
            if item.path.name.startswith("test_web"):
                left = "ignore:Queued a .* on a closed connection"
                item.add_marker(pytest.mark.filterwarnings(left))
                item.add_marker("thorough")


@pytest.fixture(scope="module")
def opened(device: ComputeDevice, tmp_path_factory: pytest.TempPathFactory) -> Iterator[User]:
    """One viewer for all tests of a file."""
    from tests.viewer.screen.user import seated

    with seated(device, tmp_path_factory.mktemp("desktop")) as user:
        yield user


@pytest.fixture
def user(opened: User) -> Iterator[User]:
    """Before the viewer as it was opened."""
    opened.away()
    yield opened
    opened.reset()


@pytest.fixture
def wide(user: User) -> Iterator[User]:
    """Before a window that has room for everything at the bottom."""
    (width, height), narrow = user.app.window.size, user.app.picture_view.rectangle[2]
    user.app.window.size = width + 500, height
    user.until(lambda: user.app.picture_view.rectangle[2] == narrow + 500)
    yield user
    user.app.window.size = width, height
    user.until(lambda: user.app.picture_view.rectangle[2] == narrow)


@pytest.fixture(scope="module")
def viewer(device: ComputeDevice, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """One viewer for browsers of a clip, for all tests of a file."""
    from tests.clips import write_clip
    from tests.viewer.screen.web import serving

    with serving(device, write_clip(tmp_path_factory.mktemp("web") / "clip", 4, fps=2.0)) as place:
        yield place


@pytest.fixture
def place(viewer: Place) -> Iterator[Place]:
    """That viewer, visited by nobody yet."""
    from tests.viewer.screen.web import cleared

    with cleared(viewer) as place:
        yield place
