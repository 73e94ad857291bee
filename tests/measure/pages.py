"""Report pages as a browser reads them."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import ClassVar

import numpy as np
from PIL import Image


class Page(HTMLParser):
    """Tags and attributes; fails where a tag is closed that is not open."""

    VOID: ClassVar = {"meta", "img", "br"}

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def named(self, name: str) -> list[dict[str, str | None]]:
        return [attrs for tag, attrs in self.tags if tag == name]


def page_of(path: Path) -> Page:
    """A page that a browser can show without fetching anything, with pictures that can be read."""
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"https?:|//|url\(|@import|<script", re.sub(r"data:\S+", "", text))
    page = Page(text)
    sources = [attrs["src"] for attrs in page.named("img")]
    for source in sources:
        assert source is not None
        assert source.startswith("data:image/png;base64,")
        with Image.open(io.BytesIO(base64.b64decode(source.partition(",")[2]))) as image:
            assert image.size[0] > 0
            assert np.isfinite(np.asarray(image)).all()
    return page
