"""Views: where image points lie in the world, and back."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.camera import Projection, View

SCREEN = View(96, 64, yaw_deg=30.0, pitch_deg=20.0, fov_y_deg=50.0)
AROUND = View(96, 48, yaw_deg=30.0, projection="equirect")


@pytest.mark.parametrize("view", [SCREEN, AROUND], ids=lambda view: view.projection)
def test_projecting_undoes_unprojecting(view: View) -> None:
    pixels = np.stack(np.meshgrid(np.arange(view.width), np.arange(view.height)), -1) + 0.3
    directions = view.unproject(pixels)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0, rtol=1e-12)
    for distance in (0.01, 1.0, 70.0):
        np.testing.assert_allclose(view.project(distance * directions), pixels, atol=1e-9)


def test_a_perspective_view_looks_where_its_angles_say() -> None:
    yaw, pitch, half = np.deg2rad([30.0, 20.0, 25.0])
    ahead = [np.cos(pitch) * np.sin(yaw), np.sin(pitch), -np.cos(pitch) * np.cos(yaw)]
    np.testing.assert_allclose(SCREEN.unproject(np.array([48.0, 32.0])), ahead, atol=1e-12)
    # The middle of the upper edge is half a field of view higher.
    top = [np.cos(pitch + half) * np.sin(yaw), np.sin(pitch + half)]
    np.testing.assert_allclose(SCREEN.unproject(np.array([48.0, 0.0]))[:2], top, atol=1e-12)
    # To the right of the view is yaw 120 degrees, on the horizon.
    right = SCREEN.unproject(np.array([96.0, 32.0])) @ [np.cos(yaw), 0.0, np.sin(yaw)]
    assert right == pytest.approx(np.sin(np.arctan(np.tan(half) * 96 / 64)))
    assert np.isnan(SCREEN.project(-np.array(ahead))).all()


def test_an_equirect_view_is_the_panorama_of_the_scene_format() -> None:
    view = View(360, 180, projection="equirect")
    points = {(180.0, 90.0): (0, 0, -1), (270.0, 90.0): (1, 0, 0), (90.0, 90.0): (-1, 0, 0)}
    points |= {
        (0.0, 90.0): (0, 0, 1),
        (180.0, 0.0): (0, 1, 0),
        (180.0, 45.0): (0, 0.5**0.5, -(0.5**0.5)),
    }
    for pixel, direction in points.items():
        np.testing.assert_allclose(view.unproject(np.array(pixel)), direction, atol=1e-12)


@pytest.mark.parametrize("view", [SCREEN, AROUND], ids=lambda view: view.projection)
def test_kernels_get_rotation_focal_length_centre_size_and_projection(view: View) -> None:
    constants = view.kernel_constants()
    np.testing.assert_allclose(constants[:9].reshape(3, 3), view.world_from_view, atol=1e-6)
    focal = view.height / 2 / np.tan(np.deg2rad(view.fov_y_deg / 2))
    size = [view.width, view.height]
    equirect = view.projection == "equirect"
    np.testing.assert_allclose(
        constants[9:], [focal, view.width / 2, view.height / 2, *size, equirect, 0], rtol=1e-6
    )


@pytest.mark.parametrize("scale", [2, 3, 4])
@pytest.mark.parametrize("size", [(64, 48), (65, 47)])
def test_a_reduced_view_has_a_pixel_for_each_block(size: tuple[int, int], scale: int) -> None:
    view = View(*size, yaw_deg=20.0, pitch_deg=-30.0, fov_y_deg=75.0)
    small = view.reduced(scale)
    assert (small.width, small.height) == (-(-size[0] // scale), -(-size[1] // scale))
    assert small.focal_px == pytest.approx(view.focal_px / scale, rel=1e-12)
    middle = np.array(size) / 2.0
    np.testing.assert_allclose(
        small.unproject(np.array([small.width, small.height]) / 2.0), view.unproject(middle)
    )


@pytest.mark.parametrize("projection", ["perspective", "equirect"])
def test_directions_are_those_of_pixel_centres(projection: Projection) -> None:
    view = View(12, 6, yaw_deg=20.0, pitch_deg=-30.0, projection=projection)
    column, row = 9, 4
    expected = view.unproject(np.array([column + 0.5, row + 0.5]))
    np.testing.assert_allclose(view.directions()[row, column], expected, atol=1e-12)
