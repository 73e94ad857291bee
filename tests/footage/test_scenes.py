"""Depth of the scenes that come with iprt is taken for what it is, and recognised otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest

from iprt.footage.depth_summary import DepthSummary
from iprt.footage.prepare.enlarge import Grid
from iprt.footage.prepare.remarks import depth_doubts, interpolation
from iprt.footage.readings import likely_reading
from iprt.scene.scene import Scene
from tests.footage.prepare.test_enlarge import quantised, repeated
from tests.footage.test_readings import READINGS, as_read

SCENES = Path(__file__).resolve().parents[2] / "scenes360"


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["room", "lounge", "train", "chart"])
def test_depth_of_scenes(name: str) -> None:
    frames = Scene.open(SCENES / name).raw_frames
    depth = frames.read(frames.source.indices[0]).depth
    assert depth_doubts(frames) == interpolation(frames) == []
    place = DepthSummary.of(depth)
    assert place is not None
    assert place.warnings() == []
    assert name == "lounge" or 1.3 <= (place.floor_m or 0.0) <= 1.51, "as its README says"
    for reading in READINGS:
        written = as_read(depth, reading)
        assert likely_reading(written, is_cube=reading == "twice") == reading
    for how, stored in quantised(depth).items():
        assert Grid.of(stored) is None, how
        grid = Grid.of(repeated(stored[::4, ::4], depth.shape[0] * 5 // 8))
        # Too little is left to tell of some scenes in decimetres.
        assert how == "decimetres" or (grid is not None and grid.size[1] == len(stored[::4])), how
