"""Renders from the browser, as one who sits before it orders, fetches and ends them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.commands.test_faults import DEVICE
from tests.viewer.screen.browsing import Visitor, until
from tests.viewer.screen.web import Place, at_rest, button, choose

LARGE = (900, 900)


def words(visitor: Visitor, kind: str) -> str:
    """What a line of the panel says; empty if there is none."""
    return " ".join(visitor.page.locator(f".{kind}").all_inner_texts())


def test_pictures_are_rendered_fetched_and_cancelled(
    place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("IPRT_DEVICE", DEVICE)
    monkeypatch.setenv("XDG_PICTURES_DIR", str(tmp_path))
    visitor, browser = place.visit(LARGE)
    at_rest(visitor, browser)
    place.engine.editor.remove(["cube"])
    at_rest(visitor, browser)
    visitor.tab("Render")
    visitor.input("File").fill("shot.gif")
    until(lambda: "unknown output format '.gif'" in words(visitor, "render-problem"), "not told")
    visitor.input("File").fill("shot.png")
    until(lambda: not words(visitor, "render-problem"), "still told")
    visitor.input("Width").fill("32")
    visitor.input("Height").fill("16")
    visitor.input("Height").press("Enter")
    button(visitor, "Render").click()
    path = tmp_path / "iprt" / "shot.png"
    until(lambda: words(visitor, "render-state") == f"written: {path}", "not rendered")
    with visitor.page.expect_download() as download:
        button(visitor, "Download").click()
    assert download.value.suggested_filename == "shot.png"
    assert Path(download.value.path()).read_bytes() == path.read_bytes()
    with Image.open(path) as image:
        assert image.size == (32, 16)
        pixels = np.asarray(image)
    assert pixels.std() > 1.0
    button(visitor, "Dismiss").click()
    until(lambda: not words(visitor, "render-state"), "still listed")

    choose(visitor, "Frames", "All frames")
    visitor.input("View frames").fill("100000")
    visitor.input("View frames").press("Enter")
    until(lambda: visitor.input("File").input_value().endswith(".mp4"), "not a video")
    button(visitor, "Render").click()
    until(lambda: words(visitor, "render-state").startswith("0 of 4 frames"), "not begun")
    button(visitor, "Cancel").click()
    until(lambda: words(visitor, "render-state") == "cancelled", "not cancelled")
    until(lambda: not list((tmp_path / "iprt").glob(".iprt.lock")), "its process runs")
