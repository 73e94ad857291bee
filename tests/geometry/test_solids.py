"""Dielectrics as solids or thin walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.solids import OPEN, SWELLING, solids, swollen, with_solids
from tests.meshes import mesh_of

GLASS = Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0)


def box(material: Material = GLASS, *, faces: slice = slice(None)) -> Mesh:
    """Some faces of a box, each corner stored once for each triangle."""
    shape = trimesh.creation.box()
    corners = shape.triangles[faces].reshape(-1, 3)
    normals = shape.face_normals[faces].repeat(3, axis=0)
    return mesh_of(corners, np.arange(len(corners)), (material,), normals)


def outward(mesh: Mesh) -> bool:
    """All triangles and normals of a convex mesh around the origin face away from it."""
    corners = mesh.positions[mesh.triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = mesh.normals[mesh.triangles].mean(1)
    middle = corners.mean(1)
    return bool(((faces * middle).sum(1) > 0).all() and ((along * middle).sum(1) > 0).all())


def test_a_closed_surface_is_a_solid() -> None:
    mesh = with_solids(box())
    assert mesh.materials == (GLASS,)
    assert mesh.warnings == ()
    assert outward(mesh)


def test_an_open_one_is_a_pane() -> None:
    mesh = with_solids(box(faces=slice(1, None)))
    assert mesh.materials[0].thin
    assert mesh.warnings == (OPEN,)
    # Painted otherwise, or read again, it is not said any more, or said once.
    assert with_solids(replace(mesh, materials=(Material(),))).warnings == ()
    assert with_solids(mesh).warnings == ()


def test_a_surface_inside_out_is_turned() -> None:
    mesh = box()
    turned = replace(mesh, normals=-mesh.normals, triangles=mesh.triangles[:, ::-1].copy())
    assert not outward(turned)
    assert outward(with_solids(turned))


@pytest.mark.parametrize("material", [Material(), replace(GLASS, thin=True)])
def test_what_is_no_solid_is_left_alone(material: Material) -> None:
    mesh = box(material, faces=slice(1, None))
    found = with_solids(mesh)
    assert found.materials == (material,)
    assert found.warnings == ()


def test_each_material_by_itself() -> None:
    """A lid of another material leaves the rest open."""
    lid = (np.arange(12) < 2).astype(np.int32)
    mesh = replace(box(), materials=(GLASS, Material()), material_index=lid)
    found = with_solids(mesh)
    assert found.materials[0].thin
    assert found.materials[1] == Material()


def test_a_box_swells_by_the_same_distance_on_all_sides() -> None:
    mesh = swollen(box())
    assert solids(mesh) == (0,)
    np.testing.assert_allclose(np.abs(mesh.positions), 0.5 + SWELLING, rtol=1e-6)


def test_a_ball_swells_to_a_ball() -> None:
    shape = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    mesh = mesh_of(shape.vertices, shape.faces, (GLASS,), shape.vertices / 2.0)
    radius = np.linalg.norm(swollen(mesh).positions, axis=1)
    np.testing.assert_allclose(radius, 2.0 + 4.0 * SWELLING, rtol=1e-5)


def test_only_solids_swell() -> None:
    part = box()
    mixed = replace(
        part,
        materials=(GLASS, Material()),
        material_index=(np.arange(12) >= 6).astype(np.int32),
    )
    moved = (swollen(mixed).positions != mixed.positions).any(axis=1)
    np.testing.assert_array_equal(moved, np.arange(36) < 18)
