"""Highlights of glossy real surfaces, separated from the panorama."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.features import Features
from iprt.settings.model import Settings
from iprt.world.real import highlight as module
from iprt.world.real.highlight import Highlight
from iprt.world.real.panorama import Panorama
from tests.oracles.brdf import fresnel, specular_albedo
from tests.oracles.worlds import World
from tests.worlds import Float, bright_walls, room_frame

ROOM = World()
WIDTH, HEIGHT = 128, 64
COAT = Material("plastic", alpha=0.2, ior=1.5)
SMOOTH = Material("plastic", alpha=0.0, ior=1.5)


@dataclass(frozen=True)
class Split:
    """(H, W, 3) colors, and what is radiated; (rows, columns, 3) gain."""

    color: NDArray[np.float32]
    radiated: NDArray[np.float32]
    gain: NDArray[np.float32]

    @property
    def highlight(self) -> NDArray[np.float32]:
        return self.color - self.radiated


def split(device: ComputeDevice, frame: Frame, rays: int = 256) -> Split:
    settings = Settings.model_validate({"gloss": {"rays": rays}})
    view = View(8, 8)
    needs = Features.of([Material()], view, settings, Footage(real_materials=frame.real_materials))
    panorama = Panorama(device, frame.width, frame.height, gloss=True)
    panorama.load(frame)
    highlight = Highlight(device, panorama, needs)
    highlight.run()
    buffers = (panorama.color, panorama.radiated, highlight.gain)
    return Split(*(device.read(buffer)[..., :3] for buffer in buffers))


def glossy(frame: Frame, material: Material, where: NDArray[np.bool_] | None = None) -> Frame:
    """The frame with a glossy floor."""
    floor = frame.normal[..., 1] > 0.5 if where is None else where
    return replace(frame, gloss=floor.astype(np.uint8), real_materials=(material,))


def even(radiance: float = 2.0) -> Frame:
    frame = ROOM.frame(WIDTH, HEIGHT)
    return replace(frame, color=np.full((HEIGHT, WIDTH, 3), radiance, np.float32))


def cosines(frame: Frame) -> Float:
    """(H, W) between the normals and the directions to the capture centre."""
    directions = View(frame.width, frame.height, projection="equirect").directions()
    return np.asarray(-(frame.normal * directions).sum(-1))


@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.5])
def test_even_light_is_reflected_by_the_albedo_of_the_coat(
    device: ComputeDevice, alpha: float
) -> None:
    """The floor adds it to its diffuse reflection."""
    material = replace(COAT, alpha=alpha)
    frame = glossy(even(), material)
    cosine, floor = cosines(frame), frame.gloss == 1
    nodes = np.linspace(0.05, 1.0, 20)
    albedos = [
        specular_albedo(material, np.array([np.sqrt(1.0 - c * c), 0.0, c]), nodes=100)[0]
        for c in nodes
    ]
    specular = 2.0 * np.interp(cosine, nodes, albedos)
    color = np.where(floor, 0.6 + specular, 2.0)[..., None] * np.ones(3)
    found = split(device, replace(frame, color=color.astype(np.float32)))
    for low, high in ((0.5, 0.6), (0.7, 0.8), (0.9, 1.0)):
        ring = floor & (cosine > low) & (cosine < high)
        np.testing.assert_allclose(found.highlight[ring].mean(0), specular[ring].mean(), rtol=0.03)
    np.testing.assert_allclose(found.gain, 1.0, atol=0.05)


def test_what_is_diffuse_keeps_its_bits(device: ComputeDevice) -> None:
    frame = glossy(room_frame(ROOM, WIDTH, HEIGHT, bright_walls), COAT)
    found = split(device, frame, rays=4)
    diffuse = frame.gloss == 0
    np.testing.assert_array_equal(found.color, frame.color)
    np.testing.assert_array_equal(found.radiated[diffuse], frame.color[diffuse])


def test_no_more_is_taken_than_there_is(device: ComputeDevice) -> None:
    """A black floor in a bright room; 1 / 4 of it is missing from the region."""
    frame = room_frame(ROOM, WIDTH, HEIGHT, bright_walls)
    floor = frame.normal[..., 1] > 0.5
    color = np.where(floor[..., None], np.float32(1e-3), frame.color)
    color[:, ::3] = np.where(floor[:, ::3, None], 0.0, color[:, ::3])
    found = split(device, glossy(replace(frame, color=color), COAT), rays=16)
    assert (found.radiated >= 0.0).all()
    assert (found.radiated <= color).all()


def test_a_smooth_coat_mirrors_the_room(device: ComputeDevice) -> None:
    """Fresnel's reflectance times the light from the mirror's direction, in every texel."""
    frame = mirrored_room(SMOOTH)
    found = split(device, frame, rays=1)
    wanted = mirror_image(frame)
    floor = frame.gloss == 1
    error = np.abs(found.highlight - wanted)[floor].max(-1) / wanted[floor].max(-1)
    # Beside the walls, rays start a texel above the floor; the gain holds some to 0.85.
    assert np.median(error) < 0.05
    assert (error < 0.2).mean() > 0.85


def test_few_rays_are_filtered_to_what_many_find(device: ComputeDevice) -> None:
    frame = mirrored_room(COAT)
    floor = frame.gloss == 1
    many = split(device, frame, rays=1024).highlight[floor]
    error = split(device, frame, rays=2).highlight[floor] / many - 1.0
    assert np.abs(error.mean()) < 0.03
    assert np.sqrt((error**2).mean()) < 0.12


def test_each_place_is_held_to_the_highlight_that_was_seen_there(device: ComputeDevice) -> None:
    """The camera saw none in a fifth of the azimuths, although the walls there are as bright."""
    unseen = np.arange(104, 152)
    frame, wanted = partly_seen_floor(unseen)
    found = split(device, frame, rays=1).highlight.mean(-1)
    slant = (frame.gloss == 1) & (np.abs(cosines(frame) - 0.6) < 0.1)
    columns = np.arange(frame.width)
    middle = np.abs(columns - unseen.mean()) < 4
    far = np.abs(columns - unseen.mean()) > unseen.size
    assert np.median(found[slant & middle] / wanted[slant & middle]) < 0.4
    assert 0.7 < np.median(found[slant & far] / wanted[slant & far]) < 1.05


def test_rays_find_the_whole_radiance_of_a_conductor(device: ComputeDevice) -> None:
    frame = glossy(room_frame(ROOM, WIDTH, HEIGHT, bright_walls), Material("conductor"))
    found = split(device, frame, rays=1)
    assert frame.gloss.any()
    np.testing.assert_array_equal(found.radiated, frame.color)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (2, 1), (12, 6), (130, 67)])
def test_any_size(device: ComputeDevice, width: int, height: int) -> None:
    frame = room_frame(ROOM, width, height, bright_walls)
    found = split(device, glossy(frame, COAT, np.ones((height, width), bool)), rays=1)
    assert np.isfinite(found.radiated).all()


def mirrored_room(material: Material) -> Frame:
    """A room whose floor is grey and reflects the bright walls as the material's coat does."""
    frame = glossy(room_frame(ROOM, WIDTH, HEIGHT, bright_walls), material)
    floor = (frame.gloss == 1)[..., None]
    color = np.where(floor, 0.5 + mirror_image(frame), frame.color)
    return replace(frame, color=color.astype(np.float32))


def partly_seen_floor(unseen: NDArray[np.int64]) -> tuple[Frame, Float]:
    """Among very bright walls a floor that mirrors them, but not in these columns of its picture;
    and what a smooth coat would reflect, (H, W).
    """
    frame = glossy(room_frame(ROOM, 256, 128, bright_walls), SMOOTH)
    floor = (frame.gloss == 1)[..., None]
    specular = 30.0 * mirror_image(frame)
    color = np.where(floor, 3.0 + specular, 30.0 * frame.color)
    color[:, unseen] = np.where(floor[:, unseen], 3.0, color[:, unseen])
    return replace(frame, color=color.astype(np.float32)), specular.mean(-1)


def mirror_image(frame: Frame) -> Float:
    """(H, W, 3): what the floor, if smooth, reflects towards the capture centre; 0 elsewhere."""
    directions = View(frame.width, frame.height, projection="equirect").directions()
    floor = (frame.gloss == 1)[..., None]
    points = directions * frame.depth[..., None]
    mirrored = directions * (1.0, -1.0, 1.0)
    mirrored = np.where(floor, mirrored, (0.0, 1.0, 0.0))
    start = np.where(floor, points, 0.0)
    t, normal, _ = ROOM.first_hit(start, mirrored)
    light = bright_walls(start + t[..., None] * mirrored, normal)
    return np.where(floor, fresnel(cosines(frame), 1.5)[..., None] * light, 0.0)


def test_paths_of_a_first_frame_are_kept(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Another process finds the same highlights without tracing."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "WORTH_KEEPING", 1)
    frame = glossy(room_frame(ROOM, WIDTH, HEIGHT, bright_walls), COAT)
    traced = split(device, frame, rays=4)

    def refuse(*_: Any) -> None:
        raise AssertionError("traced again")

    monkeypatch.setattr(Highlight, "_trace_rays", refuse)
    found = split(device, frame, rays=4)
    for name, picture in vars(traced).items():
        np.testing.assert_array_equal(getattr(found, name), picture)
    with pytest.raises(AssertionError, match="traced again"):
        split(device, frame, rays=5)
    nearer = replace(frame, depth=frame.depth * np.float32(0.999))
    with pytest.raises(AssertionError, match="traced again"):
        split(device, nearer, rays=4)
