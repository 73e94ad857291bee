"""The status panel: picture, quality, activity and problems."""

from __future__ import annotations

from html import escape

from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.web.browser_state import BrowserState

LINES, LINE_EM = 6, 1.5
"""Height of the status panel."""


def status_html(ui: BrowserState) -> str:
    """Return the contents of the status panel.

    Its height is fixed, so that the parts below stay in place. Long lines are cut off, with the
    full text as a tooltip. More lines are reached by scrolling.
    """
    status, displayed = ui.engine.status, ui.displayed
    lines = [_line("state", status.text)]
    lines += [_news("problem", "#ff8787", problem) for problem in status.problems]
    if displayed is not None and displayed.warning:
        lines.append(_news("warning", "#ffc078", displayed.warning))
    lines += [_news("note", "#74c0fc", note) for note in status.notes]
    if displayed is not None:
        lines += _picture(displayed, "lossless" if ui.lossless else "JPEG")
    if ui.read is not None:
        (_, place), *values = ui.read.rows()
        text = "; ".join([place, *(f"{name} {value}" for name, value in values)])
        lines.append(_line("pixel", text, lines=LINES - 1))
    style = (
        f"height:{LINES * LINE_EM}em;overflow-y:auto;box-sizing:content-box;font-size:.8em;"
        f"line-height:{LINE_EM}em;padding:.4em .6em;overflow-wrap:anywhere"
    )
    return f"<div class='status' style='{style}'>{''.join(lines)}</div>"


def _picture(displayed: DisplayedFrame, sent: str) -> list[str]:
    words, preview, lines = displayed.figures(), displayed.preview, []
    size = f"{words['size']}, {sent}"
    if preview is None:
        lines.append(_line("picture", size))
    else:
        lines.append(_line("picture", preview.short, f"{size}. {preview.details}"))
    if displayed.shown.plain:
        lines.append(_line("shows", "the video; objects follow"))
    else:
        lines.append(_line("frames", ", ".join(filter(None, (words["frames"], words["noise"])))))
    if speed := ", ".join(filter(None, (words["rate"], words["latency"]))):
        lines.append(_line("speed", speed))
    if displayed.caption:
        lines.append(_line("shows", displayed.caption))
    return lines


def _line(name: str, text: str, about: str = "", *, lines: int = 1) -> str:
    """Return a name with at most `lines` lines of text, and a tooltip."""
    cut = (
        "display:-webkit-box;-webkit-box-orient:vertical;overflow:hidden;"
        f"-webkit-line-clamp:{lines}"
    )
    return (
        f"<div style='display:flex;gap:.6em' title='{escape(about or text)}'>"
        f"<span style='opacity:.6;width:5em;flex:none'>{name}</span>"
        f"<span class='{name}' style='{cut}'>{escape(text)}</span></div>"
    )


def _news(kind: str, color: str, text: str) -> str:
    return f"<div class='{kind}' style='color:{color}'>{escape(text)}</div>"
