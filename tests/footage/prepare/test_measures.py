"""Measures that follow a video's depth are those of each frame alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.frame import OF_DEPTH, Frame
from iprt.footage.prepare.measures import Measures

Picture = NDArray[np.float32]


def frame_of(depth: Picture) -> Frame:
    return Frame(np.zeros((*depth.shape, 3), np.float32), depth, np.zeros(depth.shape, bool))


def film(height: int) -> list[Picture]:
    """Depth with open sky, of which some rows change: a little, to sky, and by a lot."""
    rng = np.random.default_rng(1)
    depth = rng.gamma(3.0, 1.0, (height, 2 * height)).astype(np.float32) + np.float32(0.1)
    depth[: height // 4] = np.inf
    frames = [depth]
    for step in range(6):
        depth = depth.copy()
        rows = rng.random(height) < 0.2
        depth[rows] *= np.float32(rng.uniform(0.9, 1.1))
        depth[height // 2, :step] = np.inf
        frames += [depth, depth.copy()]
    frames.append(depth * np.float32(7.0))
    frames += [np.full_like(depth, np.inf), frames[0]]
    nearer = frames[0].copy()
    nearer[: int(0.9 * height)] = 0.01
    return [*frames, nearer]


@pytest.mark.parametrize("height", [1, 2, 3, 16, 200])
def test_measures_are_those_of_the_frame(height: int) -> None:
    measures = Measures()
    for depth in film(height):
        mine = measures(frame_of(depth))
        assert set(OF_DEPTH) <= vars(mine).keys()
        alone = frame_of(depth)
        for name in OF_DEPTH:
            assert getattr(mine, name) == pytest.approx(getattr(alone, name), rel=1e-7), name


def test_rows_that_stay_are_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    depth = film(64)[0]
    measures = Measures()
    measures(frame_of(depth))
    later = depth.copy()
    later[40, 3] *= np.float32(1.01)
    looked: list[int] = []
    whole = Measures._measured

    def counted(self: Measures, given: Picture, rows: NDArray[np.intp]) -> dict[str, float]:
        looked.append(len(rows))
        return whole(self, given, rows)

    monkeypatch.setattr(Measures, "_measured", counted)
    assert measures(frame_of(later)).median_depth == frame_of(later).median_depth
    assert looked == [1]


def test_measures_go_on_from_known_ones() -> None:
    first, *later = film(16)
    measures = Measures()
    measures.know(first, Measures().of(first))
    for depth in (first, first.copy(), *later):
        mine = measures(frame_of(depth))
        for name in OF_DEPTH:
            assert getattr(mine, name) == pytest.approx(getattr(frame_of(depth), name), rel=1e-7), (
                name
            )
