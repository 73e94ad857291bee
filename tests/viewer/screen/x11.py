"""A screen of the tests' own, with a mouse and keys: Xvfb, and events by its XTEST extension."""

from __future__ import annotations

import os
import select
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from Xlib import XK, X
from Xlib.display import Display
from Xlib.ext import xtest

from tests.waiting import DEADLINE_S


@contextmanager
def xvfb(width: int, height: int) -> Iterator[str]:
    """An X server on a free display, `:N`, while it is used."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{width}x{height}x24"]
    server = subprocess.Popen(
        [*command, "-nolisten", "tcp"],
        pass_fds=(write,),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    try:
        ready, _, _ = select.select([read], [], [], DEADLINE_S)
        number = os.read(read, 16).strip().decode() if ready else ""
        assert number, "Xvfb did not start"
        yield f":{number}"
    finally:
        os.close(read)
        server.terminate()
        server.wait()


class Screen:
    """What a user sees and does. Everything is in pixels of the screen."""

    def __init__(self, display: str) -> None:
        self._display = Display(display)
        self._root = self._display.screen().root

    def close(self) -> None:
        self._display.close()

    def picture(self, left: int, top: int, width: int, height: int) -> NDArray[np.uint8]:
        """(height, width, 3) what the screen shows there."""
        raw = self._root.get_image(left, top, width, height, X.ZPixmap, 0xFFFFFFFF)
        pixels = np.frombuffer(raw.data, np.uint8).reshape(height, width, 4)
        return np.ascontiguousarray(pixels[..., 2::-1])

    def move(self, x: float, y: float) -> None:
        xtest.fake_input(self._display, X.MotionNotify, x=round(x), y=round(y))
        self._display.sync()

    def button(self, number: int, *, down: bool) -> None:
        """1: left, 3: right; 4 and 5: the wheel."""
        xtest.fake_input(self._display, X.ButtonPress if down else X.ButtonRelease, number)
        self._display.sync()

    def wheel(self, steps: int) -> None:
        for _ in range(abs(steps)):
            for down in (True, False):
                self.button(4 if steps > 0 else 5, down=down)

    def key(self, name: str, *, control: bool = False) -> None:
        """Press and release; the name is one of X's keysyms."""
        names = ["Control_L", name] if control else [name]
        for down, order in ((True, names), (False, names[::-1])):
            for each in order:
                self.hold(each, down=down)

    def hold(self, name: str, *, down: bool) -> None:
        """Press a key, or let go of it."""
        code = self._display.keysym_to_keycode(XK.string_to_keysym(name))
        xtest.fake_input(self._display, X.KeyPress if down else X.KeyRelease, code)
        self._display.sync()

    def focus(self) -> None:
        """On the topmost window: no window manager does it."""
        for window in reversed(self._root.query_tree().children):
            if window.get_attributes().map_state == X.IsViewable:
                window.set_input_focus(X.RevertToParent, X.CurrentTime)
                self._display.sync()
                return
