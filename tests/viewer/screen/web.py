"""A viewer of a clip for browsers, and those who visit it."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from numpy.typing import NDArray
from PIL import Image
from websockets.client import ClientProtocol
from websockets.typing import Origin, Subprotocol
from websockets.uri import parse_uri

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.viewport import Viewport
from iprt.viewer.web.browser import Browser
from iprt.viewer.web.host import Host
from iprt.viewer.windows import Start
from tests.viewer.screen.browsing import SIZE, Visitor, browsing, until
from tests.viewer.turns import SETTINGS
from tests.waiting import DEADLINE_S

PASSIVE = "preventDefault inside passive event listener"
"""What viser's page says of itself when something in the scene is dragged."""
FRAMES = 6
"""View frames to which pictures at rest are refined here."""


@dataclass
class Place:
    """A viewer, and what opens pages of it."""

    engine: Engine
    host: Host
    open: Callable[..., Visitor]
    visitors: list[Visitor]

    def visit(self, size: tuple[int, int] = SIZE) -> tuple[Visitor, Browser]:
        before = self.host.browsers
        visitor = self.open(self.host.url, size)
        self.visitors.append(visitor)
        return visitor, next(b for b in self.host.browsers if b not in before)


@contextmanager
def serving(device: ComputeDevice, folder: Path) -> Iterator[Place]:
    """A viewer of the scene in a folder, which begins as `iprt view` does."""
    scene = Scene.open(folder)
    listed = scene.manifest.views[0].objects
    start = Start(scene.views["ahead"].view, None if listed is None else tuple(listed))
    with (
        pytest.MonkeyPatch.context() as patch,
        browsing() as opened,
        Engine(scene, lambda: device, SETTINGS) as engine,
        Host(engine, start, 0) as host,
    ):
        few = partial(Viewport, frames=FRAMES)
        patch.setattr("iprt.viewer.web.browser.Viewport", few)
        yield Place(engine, host, opened, [])


@contextmanager
def cleared(viewer: Place) -> Iterator[Place]:
    """Without anybody, before and after; pages must not complain, nor ask for anything else."""
    yield viewer
    for visitor in viewer.visitors:
        visitor.page.close()
    errors = [error for visitor in viewer.visitors for error in visitor.errors]
    elsewhere = [url for visitor in viewer.visitors for url in visitor.elsewhere]
    viewer.visitors.clear()
    until(lambda: not viewer.host.browsers, "browsers are still there")
    assert errors == []
    assert elsewhere == []


def at_rest(visitor: Visitor, browser: Browser) -> View:
    """Wait until the picture is what the browser looks at, refined; the view."""

    def differences() -> dict[str, object]:
        displayed, view = browser.displayed, browser.viewport.view
        if displayed is None:
            return {"picture": None}
        looks = [*view.world_from_view @ (0.0, 0.0, -1.0), view.fov_y_deg]
        pairs = {
            "lossless": (browser.lossless, True),
            "refined": (displayed.shown.refined, True),
            "view": (displayed.shown.request.view, view),
            "canvas": (visitor.canvas(), (view.width, view.height)),
            "looks": (tuple(visitor.looks().round(4)), tuple(np.round(looks, 4))),
        }
        return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}

    until(lambda: not differences(), lambda: f"the picture does not come to rest: {differences()}")
    return browser.viewport.view


def cube_middle(place: Place) -> NDArray[np.float64]:
    state = place.engine.objects[0]
    return state.to_world[:3, :3] @ np.mean(state.corners, axis=0) + state.to_world[:3, 3]


def cube_pivot(place: Place) -> NDArray[np.float64]:
    return place.engine.objects[0].pivot


def screen(visitor: Visitor) -> NDArray[np.uint8]:
    """(H, W, 3): the window."""
    return np.asarray(Image.open(BytesIO(visitor.page.screenshot())).convert("RGB"))


def button(visitor: Visitor, name: str) -> Any:
    return visitor.page.get_by_role("button", name=name, exact=True)


def box(visitor: Visitor, name: str) -> Any:
    """The check box of that label."""
    return visitor.page.get_by_label(name, exact=True)


def is_grey(visitor: Visitor, label: str) -> bool:
    """Whether a labelled slider cannot be moved."""
    path = f"//label[normalize-space()='{label}']/following::*[@role='slider'][1]"
    return bool(visitor.page.locator(f"xpath={path}").get_attribute("aria-disabled") == "true")


def choose(visitor: Visitor, label: str, option: str) -> None:
    """Choose an option of a dropdown."""
    visitor.input(label).click()
    visitor.page.get_by_role("option", name=option, exact=True).click()


def bar(visitor: Visitor) -> float | None:
    """The column at which a bright line goes from the upper to the lower end of the picture."""
    image = screen(visitor)[:, : round(visitor.canvas()[0]) - 20].min(axis=2).astype(int)
    stands_out = (image[:, 5:-5] > np.maximum(image[:, :-10], image[:, 10:]) + 15).mean(axis=0)
    column = int(np.argmax(stands_out))
    return column + 5.0 if stands_out[column] > 0.9 else None


def connected(url: str, origin: str | None = None) -> socket.socket:
    """Connect a client that says where it looks from, as the script of a page of `origin`."""
    address = parse_uri(url.replace("http", "ws"))
    connection = socket.create_connection((address.host, address.port), DEADLINE_S)
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    client = ClientProtocol(
        address, subprotocols=[protocol], origin=None if origin is None else Origin(origin)
    )
    client.send_request(client.connect())
    connection.sendall(b"".join(client.data_to_send()))
    while not client.events_received():
        client.receive_data(connection.recv(65536))
    view = {
        "type": "ViewerCameraMessage",
        "wxyz": (0.0, 1.0, 0.0, 0.0),
        "position": (0.0, 0.0, 0.0),
        "fov": 1.0,
        "near": 0.01,
        "far": 1000.0,
        "image_height": 16,
        "image_width": 32,
        "look_at": (0.0, 0.0, -1.0),
        "up_direction": (0.0, 1.0, 0.0),
    }
    client.send_binary(msgspec.msgpack.encode(view))
    connection.sendall(b"".join(client.data_to_send()))
    return connection
