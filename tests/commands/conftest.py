"""`iprt render` without a device: pictures that tell of which frame they are."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.commands.render import render
from iprt.commands.render_flags import RenderFlags
from iprt.commands.render_job import RenderJob
from iprt.convergence import Goal
from iprt.device.profile import Profile
from iprt.film import view_at
from iprt.renderer import RenderedFrame
from iprt.settings.model import Settings
from tests.clips import write_clip
from tests.profiles import frame


class FakeFilm:
    """Pictures whose red channel is the number of view frames; green tells the video's frame.

    Before each frame in `ends` is rendered, the first of its errors is raised, once.
    """

    calls: list[tuple[Any, ...]]
    ends: dict[int, list[BaseException]]
    prepare_ms = 1.0

    def __init__(self, device: Any, settings: Settings, view: Any, accumulate: int) -> None:
        self.device, self.view, self.accumulate = device, view, accumulate
        self.settings = settings

    def __enter__(self) -> FakeFilm:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def frames(
        self,
        indices: Sequence[int],
        *,
        warm_up: int = 0,
        wanted: Container[int] | None = None,
        aovs: tuple[str, ...] = (),
        progress: Callable[[int], None],
        goal: Goal | None = None,
    ) -> Iterator[tuple[int, RenderedFrame]]:
        before = range(indices[0] - warm_up, indices[0])
        shown = [i for i in (*before, *indices) if wanted is None or i in wanted]
        self.calls.append((shown, warm_up, aovs, self.accumulate, self.settings))
        for index in shown:
            if self.ends.get(index):
                raise self.ends[index].pop(0)
            for _ in range(self.accumulate):
                frame(self.device.profile, {"march": 3.0})
            while goal is not None and goal.next_frames > goal.frames:
                shade = np.float32(0.5 + 0.2 / goal.next_frames)  # its noise halves
                goal.add(goal.next_frames, np.full((2, 2, 3), shade))
            progress(self.accumulate)
            color = np.zeros((self.view.height, self.view.width, 3), np.float32)
            color[..., 0], color[..., 1] = self.accumulate, 0.1 * index
            layers = {"normal": color, "depth": np.full(color.shape[:2], 2.5, np.float32)}
            yield index, RenderedFrame(color, {name: layers[name] for name in aovs})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_clip(tmp_path / "room")


@pytest.fixture
def command(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """`iprt render` with a fake device and film; keywords are flags."""
    monkeypatch.setattr(FakeFilm, "calls", [], raising=False)
    monkeypatch.setattr(FakeFilm, "ends", {}, raising=False)

    def compute(*_: object) -> SimpleNamespace:
        return SimpleNamespace(
            profile=Profile(), name="a device", buffers={}, opengl={}, memory=2**30
        )

    def film(job: RenderJob, device: SimpleNamespace) -> FakeFilm:
        view = view_at(job.scene, job.view, 0)
        return FakeFilm(device, job.settings, view, job.accumulate)

    monkeypatch.setattr("iprt.device.choose.choose_device", lambda spec: spec)
    for name in ("iprt.device.counting", "iprt.commands.render_video"):
        import_module(name)  # classes derive from the one that is replaced here
    monkeypatch.setattr("iprt.device.compute.ComputeDevice", compute)
    monkeypatch.setattr("iprt.commands.render_video.ComputeDevice", compute)
    monkeypatch.setattr(RenderJob, "film", film)

    def run(**kwargs: Any) -> int:
        own = {
            name: kwargs.pop(name) for name in ("chunks", "profile", "progress") if name in kwargs
        }
        return render(folder, flags=RenderFlags(**kwargs), **own)

    return run
