"""Orders of renders and waiting for them, and edits of viewers that were killed."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest

from iprt.files.progress_line import ProgressLine
from iprt.scene.autosave import Autosave
from iprt.scene.edit_writing import NewFiles, edited_text
from iprt.scene.light_edits import UNEDITED
from iprt.scene.manifest import AUTOSAVE_NAME
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.scene import Scene
from iprt.viewer.render_order import RenderOrder
from iprt.viewer.render_queue import Render, RenderQueue
from iprt.viewer.scene_snapshot import EditedScene
from tests.viewer.turns import FEWEST
from tests.waiting import until


def order(scene: Scene, output: Path, **parts: Any) -> RenderOrder:
    """A still of the scene's first frame and first view, or what `parts` say."""
    text = (scene.root / "scene.toml").read_text()
    values: dict[str, Any] = {
        "scene": EditedScene(scene, text, (), UNEDITED),
        "view": scene.views["ahead"].view,
        "name": "ahead",
        "objects": None,
        "frames": scene.frame_indices[:1],
        "output": output,
        "quality": "balanced",
        "settings": FEWEST,
        "accumulate": 1,
    }
    return RenderOrder(**{**values, **parts})


def render(queue: RenderQueue, number: int) -> Render:
    return next(render for render in queue.renders if render.number == number)


def ended(queue: RenderQueue) -> dict[str, str]:
    """The states of all renders by their file, once all have ended."""
    until(lambda: not queue.open)
    return {r.order.output.name: r.state for r in queue.renders}


def begun(queue: RenderQueue, number: int) -> None:
    """Wait until a render has told of its progress."""
    until(lambda: render(queue, number).progress != ProgressLine(0, 0))


def temporary(folder: Path, patch: pytest.MonkeyPatch) -> Path:
    """A new folder in which all temporary files are made."""
    folder.mkdir()
    patch.setattr(tempfile, "tempdir", str(folder))
    return folder


def leave_edits(scene: Scene, folder: str, **parts: Any) -> None:
    """Leave edits of the cube in a folder, as a viewer does that is killed."""
    autosave = Autosave(scene.root / AUTOSAVE_NAME / folder)
    base = (scene.root / "scene.toml").read_text()
    edit = ObjectEdit("cube", **parts)
    autosave.write(base, edited_text(NewFiles(scene, autosave.folder), [edit], UNEDITED, base))
    autosave._lock.close()
