"""Maps that lie elsewhere than the color, in USD stages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt.geometry.keyframes import ObjectMotion
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from iprt.geometry.place import Place
from iprt.scene.objects import SceneObject
from tests.geometry.usd_files import in_this_process  # noqa: F401
from tests.placed_maps import PLACED, PLACES, placed_square

pytest.importorskip("pxr", reason="needs the extra `usd`")
from pxr import Usd

from iprt.output.usd.materials import MaterialWriter, transform_of
from iprt.output.usd.objects import write_objects
from iprt.output.usd.pictures import Pictures

pytestmark = pytest.mark.usefixtures("in_this_process")


def written(folder: Path, mesh: Mesh) -> tuple[Mesh, list[str]]:
    """Return a mesh as it comes back from a stage, and what was lost."""
    stage = Usd.Stage.CreateInMemory()
    writer = MaterialWriter(stage, "/materials", Pictures(folder / "pictures"))
    entry = SceneObject("square", mesh, ObjectMotion(np.eye(4)))
    write_objects(stage, "/objects", [entry], writer, 0.0, ())
    stage.GetRootLayer().Export(str(folder / "square.usda"))
    return load_mesh(folder / "square.usda"), [*writer.lost]


def laid(mesh: Mesh, number: int) -> np.ndarray:
    """The coordinates of a map at the corners of the square, in a fixed order."""
    place = mesh.materials[0].map_places[number] or Place()
    found = place.coordinates(mesh.uvs, mesh.uvs2)
    return found[np.lexsort(mesh.positions[:, :2].T)]


def test_places_come_back(tmp_path: Path) -> None:
    turned = Place(((0.0, 1.5, 0.1), (-2.0, 0.0, 0.6)))
    material = replace(PLACED, places=(turned, *PLACES[1:], None))
    mesh = replace(placed_square(), materials=(material,))
    back, lost = written(tmp_path, mesh)
    assert (lost, back.dropped) == ([], ())
    for number in range(4):
        np.testing.assert_allclose(laid(back, number), laid(mesh, number), atol=1e-6)


def test_sheared_places_are_lost(tmp_path: Path) -> None:
    mesh = placed_square()
    back, lost = written(tmp_path, mesh)
    assert lost == ["sheared places of maps; they lie where the color does"]
    assert back.materials[0].places[0] is None
    np.testing.assert_allclose(laid(back, 3), laid(mesh, 3), atol=1e-6)


def test_a_mirrored_transform() -> None:
    degrees, scale, offset = transform_of(Place(((-2.0, 0.0, 0.5), (0.0, 3.0, 0.25)))) or ()
    assert (abs(degrees), *np.round(scale, 9), *offset) == (180.0, 2.0, -3.0, 0.5, 0.25)
