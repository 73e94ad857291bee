"""The bars at the bottom: the video's, and the line that tells how the picture is."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.desk import Desk
from iprt.viewer.desktop.style import ACCENT, BAD, GOOD, QUIET, Color
from iprt.viewer.desktop.widgets import button

HELP = "H: keys"
SHORTEST_EM = 8.0
"""Of the video's slider, beside which times are told."""


def playback(desk: Desk) -> None:
    """Play, pause, step, scrub."""
    frames, scene = desk.frames, desk.engine.scene
    wide = 2.4 * imgui.get_font_size()
    if button(icons.ICON_FA_BACKWARD_STEP, "A frame back (Left)", width=wide):
        desk.step(-1)
    imgui.same_line()
    icon = icons.ICON_FA_PAUSE if desk.playing else icons.ICON_FA_PLAY
    if button(f"{icon}##play", "Play or pause (Space)", width=wide):
        desk.toggle_playing()
    imgui.same_line()
    if button(icons.ICON_FA_FORWARD_STEP, "A frame on (Right)", width=wide):
        desk.step(1)
    imgui.same_line()
    fps = scene.source.fps
    now, end = ((frame - frames[0]) / fps for frame in (desk.frame, frames[-1]))
    words = f"{now:.2f} / {end:.2f} s"
    room = imgui.calc_text_size(words).x + 2.0 * imgui.get_font_size()
    told = imgui.get_content_region_avail().x > room + SHORTEST_EM * imgui.get_font_size()
    imgui.set_next_item_width(-room if told else -1.0)
    changed, frame = imgui.slider_int("##frame", desk.frame, frames[0], frames[-1], "frame %d")
    if changed:
        desk.engine.seek(frame)
    if told:
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        imgui.text_colored(imgui.ImVec4(*QUIET), words)


def status(desk: Desk) -> None:
    """One line: what the engine does, how fast, how large and how good the picture is.

    What there is no room for is left out.
    """
    state, color = _activity(desk)
    imgui.text_colored(imgui.ImVec4(*color), state)
    gap = 1.6 * imgui.get_font_size()
    end = imgui.get_window_width() - imgui.get_style().window_padding.x
    help_left = end - imgui.calc_text_size(HELP).x
    for words, about in _figures(desk):
        imgui.same_line(0.0, gap)
        if imgui.get_cursor_pos().x + imgui.calc_text_size(words).x > help_left - gap:
            break
        imgui.text_colored(imgui.ImVec4(*QUIET), words)
        imgui.set_item_tooltip(about)
    if imgui.get_cursor_pos().x < help_left:
        imgui.same_line(help_left)
        imgui.text_colored(imgui.ImVec4(*QUIET), HELP)


def _activity(desk: Desk) -> tuple[str, Color]:
    engine, sight = desk.engine.status, desk.sight
    if engine.problems:
        return f"{icons.ICON_FA_TRIANGLE_EXCLAMATION}  {engine.problems[0]}", BAD
    if engine.doing in ("compiling", "loading"):
        return f"{engine.doing} {engine.what}", ACCENT
    if sight is not None and not sight.shown.refined:
        return "refining", ACCENT
    return ("loading", ACCENT) if sight is None else ("ready", GOOD)


def _figures(desk: Desk) -> list[tuple[str, str]]:
    """What is to be told of the picture, and what that means."""
    sight = desk.sight
    if sight is None:
        return []
    shown, view = sight.shown, sight.shown.request.view
    seconds = max(shown.seconds, 1e-6)
    frames = f"{shown.frames} frame{'s' if shown.frames > 1 else ''}"
    speed = f"{1e3 * seconds:.0f} ms  {1.0 / seconds:.1f} fps"
    if shown.compiled:
        speed = f"compiled in {seconds:.1f} s"
    figures = [
        (speed, "Of the last view frame"),
        (f"{view.width} × {view.height}", "Pixels that are rendered"),
        (frames, f"The picture is the mean of so many, of {shown.request.frames}"),
    ]
    if shown.noise is not None:
        about = "Estimated error of the picture, relative to its mean brightness"
        figures.append((f"noise {100.0 * shown.noise:.2g} %", about))
    if sight.latency_s is not None:
        words = f"latency {sight.latency_frames} fr  {1e3 * sight.latency_s:.0f} ms"
        figures.append((words, "From the last input to the picture that answers it"))
    if desk.unsaved:
        figures.append(("unsaved", "The scene's file does not have all edits yet: Ctrl+S"))
    return figures
