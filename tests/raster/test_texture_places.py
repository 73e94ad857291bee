"""Maps that lie elsewhere than the color: OpenGL reads them as if they were laid by hand."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.mesh import Mesh
from tests.placed_maps import placed_square, square_by_hand
from tests.raster.shapes import placed, rasterizer

IMAGES = ("finish", "normal", "emission")


def drawn(shape: Mesh, view: View) -> dict[str, np.ndarray]:
    """Return the pictures of a square: the maps' values, (H, W, C) each."""
    with rasterizer([placed(shape, (0.3, -0.1, -3.0), name="square")]) as opened:
        display = opened.render(view, shade=True).display
    assert display is not None
    return {"normal": display[0], "finish": display[3], "emission": display[4]}


@pytest.mark.gl
@pytest.mark.parametrize(
    "view",
    [
        View(60, 50, fov_y_deg=30.0),
        View(24, 20, fov_y_deg=60.0),
        View(400, 200, projection="equirect"),
    ],
)
def test_each_map_is_drawn_at_its_place(view: View) -> None:
    """Enlarged, and from far away."""
    found = drawn(placed_square(), view)
    for number, name in enumerate(IMAGES):
        wanted = drawn(square_by_hand(number), view)[name]
        assert wanted.std() > 0.02
        np.testing.assert_allclose(found[name], wanted, atol=0.01, err_msg=name)
