"""The window, opened by GLFW and drawn by imgui's GLFW and OpenGL backends."""

from __future__ import annotations

import ctypes
import os
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Before glfw: so that both use the same library.
from imgui_bundle import imgui, imguizmo, implot  # isort: skip
import glfw
import moderngl
import numpy as np
from imgui_bundle.imgui import backends
from numpy.typing import NDArray

from iprt.errors import DeviceError
from iprt.geometry.camera import View
from iprt.viewer.desktop.style import apply_style
from iprt.viewer.desktop.turning import BESIDE, Matrix, Turner
from iprt.viewer.requirements import ELSEWHERE
from iprt.viewer.surroundings import Surroundings

STIRRED_S, STIRRED_FRAMES = 0.6, 8
"""Least time in seconds, and least number of frames, to redraw after any input: tooltips appear,
and popups settle. The time alone would not suffice if a frame takes a tenth of a second."""


_NAMED_KEYS = {
    glfw.KEY_SPACE: "Space",
    glfw.KEY_LEFT: "←",
    glfw.KEY_RIGHT: "→",
    glfw.KEY_DELETE: "Delete",
    glfw.KEY_ESCAPE: "Esc",
    glfw.KEY_END: "End",
    glfw.KEY_F1: "F1",
    glfw.KEY_F2: "F2",
    glfw.KEY_F11: "F11",
    glfw.KEY_F12: "F12",
}
_MODIFIERS = {"Ctrl": glfw.MOD_CONTROL, "Shift": glfw.MOD_SHIFT, "Alt": glfw.MOD_ALT}


@dataclass(frozen=True)
class KeyPress:
    """A key press with its modifiers.

    Attributes
    ----------
    keys : str
        Names as on the keyboard: `Ctrl+Shift+Z`.
    repeated : bool
        True if the key is held down and repeats.
    """

    keys: str
    repeated: bool


class Window:
    """A window with its OpenGL and imgui contexts; only one may exist at a time.

    Parameters
    ----------
    title : str
    size : (width, height)
        Size in screen units.
    dropped : callable
        Called with dropped files.

    Raises
    ------
    DeviceError
        There is no display, or it has no OpenGL 3.3.
    """

    def __init__(
        self, title: str, size: tuple[int, int], dropped: Callable[[list[Path]], None]
    ) -> None:
        self._handle = handle = _opened(title, size)
        self._title, self._dropped = title, dropped
        self._framed: tuple[int, int, int, int] | None = None  # geometry before full screen
        self._context = moderngl.create_context()
        glfw.swap_interval(1)
        glfw.set_window_size_limits(handle, 1, 1, glfw.DONT_CARE, glfw.DONT_CARE)
        # glfw's stubs declare C types instead of the actual arguments.
        drop: Any = self._drop
        stir: Any = self._stir
        glfw.set_drop_callback(handle, drop)
        for listen in (
            glfw.set_window_refresh_callback,
            glfw.set_framebuffer_size_callback,
            glfw.set_window_iconify_callback,
            glfw.set_cursor_pos_callback,
            glfw.set_mouse_button_callback,
            glfw.set_scroll_callback,
        ):
            listen(handle, stir)
        typed: Any = self._type
        glfw.set_char_callback(handle, typed)
        press: Any = self._press
        glfw.set_key_callback(handle, press)
        self._presses: list[KeyPress] = []
        self._stir()
        self._texture: moderngl.Texture | None = None
        self._turner: Turner | None = None
        imgui.create_context()
        implot.create_context()
        imgui.get_io().set_ini_filename("")
        # On X11 screen units are pixels, so the content scale must be applied by imgui.
        pixels = glfw.get_framebuffer_size(handle)[0] / max(glfw.get_window_size(handle)[0], 1)
        self.scale: float = max(glfw.get_window_content_scale(handle)[0] / max(pixels, 1e-6), 1.0)
        apply_style(self.scale)
        # imgui's callbacks chain to the ones set above.
        backends.glfw_init_for_opengl(ctypes.cast(handle, ctypes.c_void_p).value or 0, True)
        backends.opengl3_init("#version 330")

    def close(self) -> None:
        """Close the window and release its contexts."""
        backends.opengl3_shutdown()
        backends.glfw_shutdown()
        implot.destroy_context()
        imgui.destroy_context()
        self._context.release()
        glfw.terminate()  # and the window with it

    @property
    def size(self) -> tuple[int, int]:
        """Size in screen units."""
        width, height = glfw.get_window_size(self._handle)
        return width, height

    @size.setter
    def size(self, size: tuple[int, int]) -> None:
        glfw.set_window_size(self._handle, *size)

    @property
    def position(self) -> tuple[int, int]:
        """Upper left corner on the screen, in screen units."""
        x, y = glfw.get_window_pos(self._handle)
        return x, y

    @property
    def closing(self) -> bool:
        """True if closing was requested."""
        return bool(glfw.window_should_close(self._handle))

    @closing.setter
    def closing(self, closing: bool) -> None:
        glfw.set_window_should_close(self._handle, closing)

    @property
    def pixels_per_unit(self) -> float:
        """Pixels per screen unit; more than 1 on high-resolution displays of some systems."""
        return float(glfw.get_framebuffer_size(self._handle)[0] / max(self.size[0], 1))

    def rename(self, title: str) -> None:
        """Set the window's title."""
        if title != self._title:
            self._title = title
            glfw.set_window_title(self._handle, title)

    def switch_full_screen(self) -> None:
        """Fill the screen, or return to the former size."""
        if self._framed is not None:
            windowed: Any = None
            glfw.set_window_monitor(self._handle, windowed, *self._framed, glfw.DONT_CARE)
            self._framed = None
        elif monitor := glfw.get_primary_monitor():
            self._framed = (*self.position, *self.size)
            mode = glfw.get_video_mode(monitor)
            glfw.set_window_monitor(self._handle, monitor, 0, 0, *mode.size, mode.refresh_rate)

    # Events -----------------------------------------------------------------------------------

    def wait(self, timeout_s: float) -> bool:
        """Process events, waiting up to `timeout_s`; return True if a redraw is needed."""
        glfw.wait_events_timeout(timeout_s)
        return self._unsettled > 0 or time.monotonic() - self._stirred_s < STIRRED_S

    def _stir(self, *_: Any) -> None:
        self._stirred_s, self._unsettled = time.monotonic(), STIRRED_FRAMES

    def take_keys(self) -> list[KeyPress]:
        """Return the keys pressed since the last call.

        They carry the modifiers of their own events. imgui knows only the modifiers held while it
        draws, and a quick Ctrl+S may begin and end between two frames.
        """
        presses, self._presses = self._presses, []
        return presses

    def _press(self, _: Any, key: int, _code: int, action: int, modifiers: int) -> None:
        self._stir()
        if action == glfw.RELEASE:
            return
        held = [name for name, bit in _MODIFIERS.items() if modifiers & bit]
        self._presses.append(KeyPress("+".join([*held, _written(key)]), action == glfw.REPEAT))

    def _type(self, _: Any, character: int) -> None:
        self._stir()
        if chr(character) == "?":  # on keys that differ by layout
            self._presses.append(KeyPress("?", repeated=False))

    def _drop(self, _: Any, files: Any) -> None:
        self._stir()
        x, y = glfw.get_cursor_pos(self._handle)
        imgui.get_io().add_mouse_pos_event(x, y)  # no motion is reported during drag and drop
        self._dropped([Path(os.fsdecode(file)) for file in files])

    # Frames -----------------------------------------------------------------------------------

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Draw by imgui inside the block, and then present the frame."""
        self._unsettled = max(self._unsettled - 1, 0)
        backends.opengl3_new_frame()
        backends.glfw_new_frame()
        imgui.new_frame()
        imguizmo.im_guizmo.begin_frame()
        yield
        imgui.render()
        self._context.screen.use()
        self._context.clear(*BESIDE)
        backends.opengl3_render_draw_data(imgui.get_draw_data())
        glfw.swap_buffers(self._handle)

    def upload(self, pixels: NDArray[np.uint8]) -> None:
        """Upload a picture (H, W, 3) for `picture`."""
        height, width = pixels.shape[:2]
        if self._texture is None or self._texture.size != (width, height):
            if self._texture is not None:
                self._texture.release()
            self._texture = self._context.texture((width, height), 3, alignment=1)
        self._texture.write(np.ascontiguousarray(pixels), alignment=1)

    def picture(self, width_px: int, height_px: int) -> Any:
        """Return imgui's reference to the uploaded picture at a size in pixels, or None."""
        texture = self._texture
        if texture is None:
            return None
        kind = moderngl.NEAREST if texture.size == (width_px, height_px) else moderngl.LINEAR
        texture.filter = kind, kind
        return imgui.ImTextureRef(texture.glo)

    def turned_picture(
        self,
        width_px: int,
        height_px: int,
        view: View,
        turn: Matrix,
        surroundings: Surroundings | None,
    ) -> Any:
        """Return imgui's reference to the picture reprojected to a view by a matrix of `turned`."""
        if self._texture is None:
            return None
        self._turner = self._turner or Turner(self._context)
        if surroundings is not None:
            self._turner.surround(surroundings)
        drawn = self._turner.draw(self._texture, turn, view, (width_px, height_px))
        return imgui.ImTextureRef(drawn.glo)


def _written(key: int) -> str:
    """Return the letter on a key by the layout, or by position for non-Latin layouts."""
    if key in _NAMED_KEYS:
        return _NAMED_KEYS[key]
    name = glfw.get_key_name(key, 0) or ""
    if name.isascii() and name.isalnum():
        return name.upper()
    return chr(key) if glfw.KEY_A <= key <= glfw.KEY_Z else ""


def _opened(title: str, size: tuple[int, int]) -> Any:
    """Open a window, and make its context current; return its GLFW handle."""
    handle = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)
        if glfw.init():
            glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
            glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
            glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
            glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
            glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
            handle = glfw.create_window(*size, title, None, None)
    if not handle:
        reason: Any = glfw.get_error()[1] or b"no reason given"
        raise DeviceError(f"no window can be opened ({reason.decode()}); {ELSEWHERE}")
    glfw.make_context_current(handle)
    return handle
