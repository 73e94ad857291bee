"""The bars at the bottom: video playback, and the status line of the picture."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.style import ACCENT, BAD, GOOD, QUIET, Color
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import button, choice, hint, toggle
from iprt.viewer.labels import PARTS, PLAYBACK

MODES = list(PLAYBACK)

HELP = "?: keys"
SHORTEST_EM = 6.0
"""Least width of the video's slider. The frame's number is beside it."""
NARROW_EM = 28.0
"""Width up to which a window shows only the slider and its buttons."""
COUNTERS = "9999 of 9999, 99.9 of 99.9 fps", "9999 of 9999"
"""Widest texts of the counter with and without the rate: the slider keeps its length while the
video plays."""
STATE_EM = 10.0
"""Least width of the engine's state."""


def playback(ui: DesktopState) -> None:
    """Draw play, pause, step, scrub and the playback mode."""
    engine, frames, counter = ui.engine, ui.frames, ui.viewport.counter
    em = imgui.get_font_size()
    wide = 2.4 * em
    if button(icons.ICON_FA_BACKWARD_STEP, "A frame back (Left)", width=wide):
        ui.step(-1)
    imgui.same_line()
    icon = icons.ICON_FA_PAUSE if ui.playing else icons.ICON_FA_PLAY
    if button(f"{icon}##play", f"{PARTS['play'].about} (Space)", width=wide):
        ui.toggle_playing()
    imgui.same_line()
    if button(icons.ICON_FA_FORWARD_STEP, "A frame on (Right)", width=wide):
        ui.step(1)
    imgui.same_line()
    if imgui.get_window_width() > NARROW_EM * em:
        _playback_mode(ui)
    rooms = [imgui.calc_text_size(text).x + em for text in COUNTERS]
    left = imgui.get_content_region_avail().x - SHORTEST_EM * em
    room = next((room for room in rooms if room < left), 0.0)
    imgui.set_next_item_width(-room if room else -1.0)
    changed, frame = imgui.slider_int("##frame", ui.frame, frames[0], frames[-1], "")
    seconds = (ui.frame - frames[0]) / engine.scene.source.fps
    hint(f"Frame {ui.frame} of scene.toml, at {seconds:.2f} s")
    if changed:
        engine.seek(frame)
    if room and counter is not None:
        counter = counter if room == rooms[0] else counter.partition(",")[0]
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        imgui.text_colored(imgui.ImVec4(*QUIET), counter)


def _playback_mode(ui: DesktopState) -> None:
    engine = ui.engine
    if toggle(f"{icons.ICON_FA_REPEAT}##loop", engine.playback.loop, PARTS["loop"].about):
        engine.set_loop(not engine.playback.loop)
    imgui.same_line()
    imgui.set_next_item_width(7.5 * imgui.get_font_size())
    mode = choice("##mode", list(PLAYBACK.values()), MODES.index(engine.playback.mode))
    if mode is not None:
        engine.set_playback_mode(MODES[mode])
    imgui.same_line()


def status(ui: DesktopState) -> None:
    """Draw the status line: the engine's state, speed, and size and quality of the picture.

    Entries without room are left out. Each has a fixed place, so that none moves as others change.
    """
    state, color = _activity(ui)
    em, start = imgui.get_font_size(), imgui.get_cursor_pos().x
    imgui.text_colored(imgui.ImVec4(*color), state)
    end = imgui.get_window_width() - imgui.get_style().window_padding.x
    help_left = end - imgui.calc_text_size(HELP).x
    place = start + max(STATE_EM * em, imgui.calc_text_size(state).x + 1.5 * em)
    for width_em, words, about in _figures(ui):
        if place + max(width_em * em, imgui.calc_text_size(words).x) > help_left:
            break
        imgui.same_line(place)
        imgui.text_colored(imgui.ImVec4(*QUIET), words)
        hint(about)
        place += width_em * em
    if start + imgui.calc_text_size(state).x < help_left:
        imgui.same_line(help_left)
        imgui.text_colored(imgui.ImVec4(*QUIET), HELP)


def _activity(ui: DesktopState) -> tuple[str, Color]:
    engine, displayed = ui.engine.status, ui.displayed
    if engine.problems:
        return f"{icons.ICON_FA_TRIANGLE_EXCLAMATION}  {engine.problems[0]}", BAD
    if engine.doing in ("compiling", "loading") or displayed is None:
        return engine.text, ACCENT
    done = engine.doing == "waiting" and displayed.shown.refined
    return ("ready", GOOD) if done else ("rendering", ACCENT)


def _figures(ui: DesktopState) -> list[tuple[float, str, str]]:
    """Return figures of the picture: width of the place in em, text, and meaning."""
    displayed = ui.displayed
    if displayed is None or displayed.shown.plain:
        return []
    words = displayed.figures()
    unsaved = f"unsaved: {', '.join(ui.engine.unsaved)}" if ui.engine.unsaved else ""
    return [
        (6.5, words["size"], "Pixels that are rendered"),
        (8.0, words["frames"], "The picture is the mean of this many rendered frames"),
        (6.5, words["noise"], "Estimated noise of the picture as displayed, of white"),
        (5.0, words["rate"], "Pictures per second while something moves"),
        (8.0, words["latency"], "From the last input to the picture that answers it"),
        (0.0, unsaved, "The scene's file does not have these edits yet: Ctrl+S"),
    ]
