"""A viewer for browsers, and Chromium to look at it."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.waiting import DEADLINE_S

FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
SIZE = (600, 240)
"""Width and height of the browser's window: a picture of 260 x 240 pixels beside the panels."""

PICTURE = """() => {
    const found = Object.entries(window.__viserSceneTree?.getState() ?? {}).filter(([name, node]) =>
        name.startsWith("/pictures/") && node.message.props.fov);
    const distance = ([, { message: { props } }]) =>
        props.scale / Math.cbrt(props.aspect * Math.tan(props.fov / 2) ** 2);
    const [newest] = found.sort((a, b) => distance(a) - distance(b))[0] ?? [];
    let map = null;
    const node = __viserMutable.nodeRefFromName[newest];
    node?.traverse((part) => (map ??= part.material?.map ?? null));
    return map?.image;
}"""
"""The newest picture that came, once it is decoded."""
DECODED = f"window.__viserMutable && ({PICTURE})()"
TEXTURE = f"""() => {{
    const image = ({PICTURE})();
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    return [image.width, image.height, Array.from(context.getImageData(0, 0, image.width,
        image.height).data)];
}}"""
FORWARD = """() => {
    const { camera, nodePoseData } = __viserMutable;
    const [w, x, y, z] = nodePoseData[""].wxyz;
    const root = camera.quaternion.clone().set(x, y, z, w).invert();
    const at = camera.position.clone().set(0, 0, -1).applyQuaternion(camera.quaternion);
    return [...at.applyQuaternion(root).toArray(), camera.fov];
}"""
PROJECT = """(point) => {
    const { camera, nodePoseData } = __viserMutable;
    const [w, x, y, z] = nodePoseData[""].wxyz;
    const root = camera.quaternion.clone().set(x, y, z, w);
    camera.updateMatrixWorld();
    const at = camera.position.clone().set(...point).applyQuaternion(root).project(camera);
    return [0.5 + 0.5 * at.x, 0.5 - 0.5 * at.y];
}"""


def until(found: Callable[[], Any], what: str | Callable[[], str]) -> Any:
    """The first truth; `what` says what is wrong if there is none."""
    end = time.monotonic() + DEADLINE_S
    while not (value := found()):
        assert time.monotonic() < end, what if isinstance(what, str) else what()
        time.sleep(0.02)
    return value


class Visitor:
    """A page of the viewer in Chromium."""

    def __init__(self, page: Any, url: str) -> None:
        self.page, self.url = page, url
        page.set_default_timeout(1000 * DEADLINE_S)
        self.errors: list[str] = []
        self.elsewhere: list[str] = []
        page.on("console", lambda m: m.type == "error" and self.errors.append(m.text))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("request", lambda request: self._requested(request.url))
        self.load()

    def _requested(self, url: str) -> None:
        if not url.startswith(("blob:", "data:", self.url)):
            self.elsewhere.append(url)

    def load(self) -> None:
        self.page.goto(self.url)
        self.page.add_style_tag(content=".mantine-Notifications-root { display: none }")
        self.decoded()

    def decoded(self) -> None:
        """Wait until the browser has decoded the newest picture that came."""
        self.page.wait_for_function(DECODED)

    def texture(self) -> NDArray[np.uint8]:
        """(H, W, 3): the picture as the browser has decoded it."""
        self.decoded()
        width, height, data = self.page.evaluate(TEXTURE)
        return np.array(data, np.uint8).reshape(height, width, 4)[..., :3]

    def project(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the browser draws a point: shares of the picture's width and height."""
        return np.array(self.page.evaluate(PROJECT, [float(value) for value in point]))

    def looks(self) -> NDArray[np.float64]:
        """Where the browser's camera looks: unit direction, and field of view in degrees."""
        return np.array(self.page.evaluate(FORWARD))

    def canvas(self) -> tuple[float, float]:
        """Width and height in pixels."""
        box = self.page.locator("canvas").first.bounding_box()
        return box["width"], box["height"]

    def drag(self, start: tuple[float, float], by: tuple[float, float], steps: int = 5) -> None:
        mouse = self.page.mouse
        mouse.move(*start)
        mouse.down()
        mouse.move(start[0] + by[0], start[1] + by[1], steps=steps)
        mouse.up()

    def input(self, label: str) -> Any:
        """The text box of a labelled number in sight; a mark says that it was changed."""
        labels = f"//label[normalize-space()='{label}' or normalize-space()='• {label}']"
        path = f"{labels}/following::input[not(@type='hidden')][1]"
        return self.page.locator(f"xpath={path}").locator("visible=true")

    def tab(self, name: str) -> None:
        self.page.get_by_role("tab", name=name, exact=True).click()


def chromium() -> str:
    """The program; skips the test where there is none."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if (found := shutil.which(name)) is not None:
            return found
    pytest.skip("needs Chromium: ./run screen")


@contextmanager
def browsing() -> Iterator[Callable[..., Visitor]]:
    """Yield a function that opens an address in a window of its own, of SIZE or another."""
    api = pytest.importorskip(
        "playwright.sync_api", reason="needs the extra `screen`: ./run screen"
    )
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        try:

            def visit(url: str, size: tuple[int, int] = SIZE) -> Visitor:
                viewport = {"width": size[0], "height": size[1]}
                return Visitor(browser.new_page(viewport=viewport), url)

            yield visit
        finally:
            browser.close()
