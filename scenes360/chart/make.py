"""Compute `scenes360/chart`: `python -m scenes360.chart.make` from the repository's root.

An orientation chart: a box room whose walls show their names and a grid of directions, every 10
degrees of azimuth and elevation. Color and depth are analytic; a lamp in the ceiling casts the
objects' shadows.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.output.picture import write_exr
from scenes360.chart.letters import text_mask
from scenes360.modelling import sphere, write_ply

FOLDER = Path(__file__).resolve().parent
PANORAMA = View(1024, 512, projection="equirect")
BOX_LOW, BOX_HIGH = np.array([-2.5, -1.5, -3.0]), np.array([3.0, 1.8, 2.5])
DEPTH_SCALE = 1e-4
LAMP_CENTRE, LAMP_HALF, LAMP_RADIANCE = (0.4, -0.9), 0.45, 14.0
SUPERSAMPLING = 4
WALLS = (  # axis, side, name, color, right and up as the capture centre sees them
    (2, 0, "FRONT -Z", (0.42, 0.16, 0.14), (1, 0, 0), (0, 1, 0)),
    (0, 1, "RIGHT +X", (0.16, 0.36, 0.18), (0, 0, 1), (0, 1, 0)),
    (2, 1, "BACK +Z", (0.16, 0.22, 0.44), (-1, 0, 0), (0, 1, 0)),
    (0, 0, "LEFT -X", (0.44, 0.38, 0.14), (0, 0, -1), (0, 1, 0)),
    (1, 1, "UP +Y", (0.46, 0.46, 0.46), (1, 0, 0), (0, 0, 1)),
    (1, 0, "DOWN -Y", (0.34, 0.30, 0.27), (1, 0, 0), (0, 0, -1)),
)
Float = NDArray[np.float64]


def main() -> None:
    """Write the scene folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder to write to")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    write_exr(out / "color.exr", panorama(), half=True)
    steps = np.round(box_depth(PANORAMA.directions()) / DEPTH_SCALE)
    imageio.imwrite(out / "depth.png", steps.astype(np.uint16))
    write_ply(out / "meshes" / "ball.ply", sphere(0.35))
    (out / "scene.toml").write_text(MANIFEST)


def box_depth(directions: Float) -> Float:
    """Return the distance (...), m, from the origin to the box along unit directions (..., 3)."""
    with np.errstate(divide="ignore"):
        wall = np.where(directions > 0.0, BOX_HIGH, BOX_LOW) / directions
    return np.asarray(np.where(np.isfinite(wall) & (wall > 0.0), wall, np.inf).min(axis=-1))


def panorama() -> NDArray[np.float32]:
    """Return (512, 1024, 3) radiance, averaged over each pixel."""
    fine = PANORAMA.resized(PANORAMA.width * SUPERSAMPLING, PANORAMA.height * SUPERSAMPLING)
    bands = []
    for row in range(0, fine.height, SUPERSAMPLING * 32):  # bounds the memory
        y, x = np.mgrid[row : row + SUPERSAMPLING * 32, 0 : fine.width] + 0.5
        color = radiance(fine.unproject(np.stack([x, y], axis=-1)))
        blocks = (32, SUPERSAMPLING, PANORAMA.width, SUPERSAMPLING, 3)
        bands.append(color.reshape(blocks).mean(axis=(1, 3)))
    return np.concatenate(bands).astype(np.float32)


def radiance(directions: Float) -> Float:
    """Return the color (..., 3) of the chart along unit directions (..., 3)."""
    points = directions * box_depth(directions)[..., None]
    color = np.zeros(directions.shape)
    for axis, side, name, base, right, up in WALLS:
        plane = (BOX_LOW, BOX_HIGH)[side][axis]
        on_wall = np.abs(points[..., axis] - plane) < 1e-9
        p = points[on_wall]
        shade = np.broadcast_to(np.asarray(base), p.shape).copy()
        shade[_checker(np.delete(p, axis, axis=1))] *= 0.82
        shade[text_mask(name, p @ np.asarray(right), p @ np.asarray(up) - 0.55, 0.05)] = 0.9
        color[on_wall] = shade
    color[_grid(directions)] = 0.62
    color[_numbers(directions)] = 0.95
    overhead = np.abs(points[..., 1] - BOX_HIGH[1]) < 1e-9
    across = np.maximum(
        np.abs(points[..., 0] - LAMP_CENTRE[0]), np.abs(points[..., 2] - LAMP_CENTRE[1])
    )
    color[overhead & (across < LAMP_HALF)] = LAMP_RADIANCE
    return color


def _checker(coordinates: Float) -> NDArray[np.bool_]:
    """Return squares of half a metre, true on every other one."""
    return np.asarray(np.floor(2.0 * coordinates + 1e-9).astype(int).sum(axis=-1) % 2 == 0)


def _angles_deg(directions: Float) -> tuple[Float, Float]:
    azimuth = np.rad2deg(np.arctan2(directions[..., 0], -directions[..., 2]))
    return azimuth, np.rad2deg(np.arcsin(np.clip(directions[..., 1], -1.0, 1.0)))


def _grid(directions: Float) -> NDArray[np.bool_]:
    """Return lines every 10 degrees, wider at 0, 90, 180 and 270 degrees and at the horizon."""
    azimuth, elevation = _angles_deg(directions)
    narrowing = np.cos(np.deg2rad(elevation))
    off_meridian = np.abs((azimuth + 5.0) % 10.0 - 5.0) * narrowing
    off_quarter = np.abs((azimuth + 45.0) % 90.0 - 45.0) * narrowing
    off_parallel = np.abs((elevation + 5.0) % 10.0 - 5.0)
    thin = (off_meridian < 0.12) & (np.abs(elevation) < 80.5) | (off_parallel < 0.12)
    return np.asarray(thin | (off_quarter < 0.3) | (np.abs(elevation) < 0.3))


def _numbers(directions: Float) -> NDArray[np.bool_]:
    """Return the ink of the numbers.

    Azimuth in degrees, turning right, just above the horizon every 30 degrees; elevation beside the
    four quarter meridians.
    """
    azimuth, elevation = _angles_deg(directions)
    mask = np.zeros(azimuth.shape, bool)
    for degrees in range(0, 360, 30):
        offset = (azimuth - degrees + 180.0) % 360.0 - 180.0
        mask |= text_mask(str(degrees), offset - 4.0, elevation - 2.8, 0.45)
    quarter = (azimuth + 45.0) % 90.0 - 45.0
    for degrees in (-60, -30, 30, 60):
        narrowing = np.cos(np.deg2rad(degrees))
        mask |= text_mask(
            f"{degrees:+d}", quarter * narrowing - 5.0, elevation - degrees - 2.8, 0.45
        )
    return mask


MANIFEST = f"""# Written by make.py.
format = 1
name = "chart"
exposure = 1.0

[video]
color = "color.exr"
depth = "depth.png"
depth_scale = {DEPTH_SCALE}
frames = [0, 0]
fps = 30.0
loop = false

[[objects]]
name = "ball"
mesh = "meshes/ball.ply"
to_world = [
  1, 0, 0, 1.0,
  0, 1, 0, -1.15,
  0, 0, 1, -1.7320508,
  0, 0, 0, 1,
]
material = {{ kind = "diffuse", albedo = [0.8, 0.8, 0.8] }}

[[views]]
name = "ball"
yaw_deg = 30
pitch_deg = -30
fov_y_deg = 50
size = [384, 384]
objects = ["ball"]
"""


if __name__ == "__main__":
    main()
