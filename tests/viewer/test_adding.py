"""A mesh that a viewer adds is what `iprt scene add` makes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.new_object import add_object
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.scene import Scene
from tests.geometry.test_stl import solid
from tests.scene.files import MANIFEST, write_scene
from tests.viewer.turns import SETTINGS, Turns


def no_device() -> ComputeDevice:
    raise AssertionError("nothing is rendered")


@pytest.mark.thorough
@pytest.mark.parametrize(
    "pose", [MeshPose(), MeshPose("z", 30.0, height_m=0.3), MeshPose("-x", -45.0, unit_m=0.1)]
)
def test_viewers_place_meshes_as_scene_add_does(pose: MeshPose, tmp_path: Path) -> None:
    room = write_scene(tmp_path / "room", MANIFEST, width=128)
    mesh = tmp_path / "m.stl"
    mesh.write_text(solid(x=2))
    turns = Turns(Scene.open(room), no_device, SETTINGS)
    turns.until(lambda: turns.core.video.frame is not None)
    turns.core.add(ObjectEdit("m", path=mesh), (20.0, -50.0), pose)
    turns.until(lambda: bool(turns.shared.world.edits))
    (edit,) = turns.shared.world.edits
    turns.core.close()
    add_object(room, mesh, 20.0, -50.0, pose=pose)
    (instance,) = Scene.open(room).instances
    assert edit.to_world is not None
    assert np.allclose(np.reshape(edit.to_world, (4, 4)), instance.to_world, atol=1e-6)
    assert edit.mesh is not None
    assert np.array_equal(edit.mesh.positions, instance.mesh.positions)
    assert np.array_equal(edit.mesh.normals, instance.mesh.normals)
