"""Whole frames from input as extreme as it gets: each has a picture that is defined."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.prepare.reading import RawFrame
from iprt.footage.prepare.stages import Preparation
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from tests.frame.whole_frame import (
    CLAY,
    METHOD,
    METHODS,
    PANORAMA,
    ROOM,
    VIEW,
    chosen,
    likeness,
    remembered,
    require_finite,
    rms,
    still_life,
    two_frames,
)
from tests.meshes import mesh_of
from tests.rendering import render
from tests.worlds import (
    Float,
    ball,
    bright_walls,
    ceiling_lamp,
    cuboid,
    landscape_frame,
    room_frame,
    sphere_frame,
)

pytestmark = pytest.mark.gl

SMALL = VIEW.resized(32, 24)

# Light ----------------------------------------------------------------------------------------


def of_everything(color: NDArray[np.floating]) -> Frame:
    """The room in other colors (128, 256, 3), with a window in the wall and a glossy floor."""
    frame = room_frame(ROOM, 256, 128, bright_walls)
    opening = np.zeros(frame.depth.shape, bool)
    opening[40:60, 150:180] = True
    return replace(
        frame,
        color=np.broadcast_to(color, frame.color.shape).astype(np.float32),
        opening=opening,
        gloss=(frame.normal[..., 1] > 0.5).astype(np.uint8),
        real_materials=(Material("plastic", alpha=0.1),),
    )


def fireflies() -> Float:
    rng = np.random.default_rng(3)
    return np.where(rng.random((128, 256, 1)) < 0.01, 65504.0, rng.random((128, 256, 3)))


def with_texel(value: float, row: int, column: int, other: float = 0.2) -> Float:
    color = np.full((128, 256, 3), other)
    color[row, column] = value
    return color


LIGHTS: dict[str, Callable[[], Float]] = {
    "largest half everywhere": lambda: np.full((1, 1, 3), 65504.0),
    "fireflies": fireflies,
    "lamp in the ceiling": lambda: with_texel(1e6, 20, 128),
    "lamp at the pole": lambda: with_texel(1e6, 0, 0),
    "lamp in the window": lambda: with_texel(1e6, 50, 160),
    "lamp in the floor": lambda: with_texel(1e6, 100, 130),
    "lamp in the dark": lambda: with_texel(1e6, 20, 128, 0.0),
    "faint lamp in the dark": lambda: with_texel(1e-30, 20, 128, 0.0),
}


@pytest.mark.thorough
@METHOD
def test_extreme_light_stays_finite(device: ComputeDevice, method: tuple[str, str]) -> None:
    """In the picture, in all that is shown beside it, and in what later frames build on."""
    plain = of_everything(room_frame(ROOM, 256, 128, bright_walls).color)
    with Renderer(device, plain, still_life(), SMALL, chosen(method)) as renderer:
        for name, color in LIGHTS.items():
            for frame, yaw_deg in ((of_everything(color()), 0.0), (plain, 3.0)):
                renderer.load(frame)
                pictures = [renderer.render(2, AOVS)]
                renderer.look(replace(SMALL, yaw_deg=yaw_deg))
                pictures.append(renderer.render(1, AOVS))
                require_finite(renderer, pictures, name)
                # Nothing of one is left in the other; single samples may be too bright.
                for image in (p.color for p in pictures):
                    assert image.max() < 4.0 * frame.color.max(), name
                for image in (p.aovs[kind] for p in pictures for kind in ("diffuse", "specular")):
                    assert image.max() < 10.0 * frame.color.max(), name


@METHOD
def test_the_faintest_light_is_light(device: ComputeDevice, method: tuple[str, str]) -> None:
    """At 1e-30, whose square is 0 in single precision, the picture has the right brightness."""
    frame = two_frames()[0]
    faint = replace(frame, color=frame.color * np.float32(1e-30))
    bright = render(device, frame, still_life(), VIEW, chosen(method), frames=2)
    picture = render(device, faint, still_life(), VIEW, chosen(method), frames=2)
    color = picture.color.astype(np.float64) * 1e30
    np.testing.assert_allclose(color.mean((0, 1)), bright.color.mean((0, 1)), rtol=0.01)
    assert likeness(color, bright.color) > 0.97


# Objects --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("solid", "view"),
    [
        (ball((0.0, 0.0, 0.0), 0.6, CLAY), PANORAMA),
        (ball((0.2, -0.1, 0.1), 0.6, CLAY), SMALL),
        (cuboid((0.1, 0.0, -0.1), (0.5, 0.4, 0.6), CLAY), SMALL),
        (ball((0.0, 0.0, 0.0), 1e-3, CLAY), SMALL),
        (ball((0.0, 0.0, 0.0), 1e-6, CLAY), PANORAMA),
    ],
    ids=["ball", "ball aside", "box", "ball of a millimetre", "ball of a micrometre"],
)
def test_inside_an_object_one_sees_its_inside(
    device: ComputeDevice, solid: Instance, view: View
) -> None:
    """Paths end in the room after four bounces, by the model: albedo^5 of its even light."""
    frame = sphere_frame(2.0, 128, 64, 0.7)
    settings = chosen(METHODS[0], iprt={"relight_reflections": False})
    picture = render(device, frame, [solid], view, settings, frames=2)
    np.testing.assert_array_equal(picture.aovs["coverage"], 1.0)
    wanted = np.broadcast_to(0.7 * np.array(CLAY.albedo) ** 5, picture.color.shape)
    # Where the walls of the box meet, a ray may start behind the other one.
    assert np.isclose(picture.color, wanted, rtol=1e-3).mean() > 0.98
    np.testing.assert_allclose(picture.color.mean((0, 1)), wanted[0, 0], rtol=0.01)


@pytest.mark.thorough
@METHOD
def test_an_object_at_the_centre_has_a_picture(
    device: ComputeDevice, method: tuple[str, str]
) -> None:
    """Triangles with a corner, an edge or their face in the capture centre, seen edge-on or not."""
    corners = np.array([[0, 0, 0], [0, 0, -1], [0, -1, -1], [0.5, -1, 0], [-0.5, -1, 0.1]], float)
    touching = odd(corners, [[0, 1, 2], [0, 3, 4], [1, 2, 3]])
    box = cuboid((0.3, -0.4, 0.0), (0.3, 0.4, 0.3), CLAY)  # an edge through the centre
    corner = cuboid((0.25, -0.5, -0.25), (0.25, 0.5, 0.25), CLAY)
    for objects in ([touching], [box, corner], [corner]):
        for view in (SMALL, PANORAMA):
            with Renderer(device, two_frames()[0], objects, view, chosen(method)) as renderer:
                picture = renderer.render(3, AOVS)
                require_finite(renderer, [picture])
    # The last box fills an eighth of all directions.
    filled = (PANORAMA.directions() * (1.0, -1.0, -1.0) > 0.1).all(-1)
    np.testing.assert_array_equal(picture.aovs["coverage"][filled], 1.0)


def odd(corners: ArrayLike, triangles: ArrayLike) -> Instance:
    """An object of such triangles with normals up."""
    return Instance("odd", mesh_of(corners, triangles, (CLAY,), (0.0, 1.0, 0.0)), np.eye(4))


def with_broken_triangles(instance: Instance) -> Instance:
    """Add lines, points, repeated and infinite triangles among the others."""
    mesh = instance.mesh
    bad = np.array([[np.nan, 0, 0], [np.inf, 0, 0], [0, 0, -np.inf]], np.float32)
    first = len(mesh.positions)
    a, b, c = mesh.triangles[0]
    broken = [[a, a, b], [c, c, c], [first, a, b], [a, first + 1, first + 2], [first] * 3]
    triangles = np.concatenate([broken, mesh.triangles, mesh.triangles[:7]]).astype(np.int32)
    repaired = replace(
        mesh,
        positions=np.concatenate([mesh.positions, bad]),
        normals=np.concatenate([mesh.normals, np.full((3, 3), np.nan, np.float32)]),
        uvs=np.concatenate([mesh.uvs, np.full((3, 2), np.nan, np.float32)]),
        triangles=triangles,
        material_index=np.zeros(len(triangles), np.int32),
    )
    return replace(instance, mesh=repaired)


@METHOD
@pytest.mark.parametrize("gbuffer", ["gl", "cl"])
def test_broken_triangles_change_nothing(
    device: ComputeDevice, method: tuple[str, str], gbuffer: str
) -> None:
    frame, objects = two_frames()[0], still_life()
    settings = chosen(method, gbuffer=gbuffer)
    whole = render(device, frame, objects, VIEW, settings, frames=2)
    broken = [with_broken_triangles(instance) for instance in objects]
    empty = [odd(np.zeros((0, 3)), []), odd(np.full((3, 3), np.nan), [0, 1, 2])]
    with Renderer(device, frame, [*broken, *empty], VIEW, settings) as renderer:
        picture = renderer.render(2, AOVS)
        require_finite(renderer, [picture])
    np.testing.assert_allclose(picture.aovs["coverage"], whole.aovs["coverage"], atol=1e-6)
    assert likeness(picture.color, whole.color) > 0.995


# Depth ----------------------------------------------------------------------------------------


@METHOD
def test_all_holes_is_a_distant_world(device: ComputeDevice, method: tuple[str, str]) -> None:
    """No shadows, and objects lit as by the panorama at infinity."""
    color = landscape_frame(256, 128).color
    frame = Preparation()(RawFrame(color, np.full(color.shape[:2], np.nan, np.float32), None))
    objects = [ball((0.1, -0.2, -1.5), 0.4, CLAY)]
    many: dict[str, Any] = {"fading": 0.0, "trace": {"rays": 8, "object_rays": 32}}
    picture = render(device, frame, objects, VIEW, chosen(method, **many), frames=4)
    far = chosen(method, **many).model_copy(update={"method": "ibl"})
    distant = render(device, frame, objects, VIEW, far, frames=4)
    real, solid = (picture.aovs["coverage"] == value for value in (0.0, 1.0))
    np.testing.assert_array_equal(picture.color[real], picture.aovs["background"][real])
    assert solid.sum() > 100
    np.testing.assert_allclose(
        picture.color[solid].mean(0), distant.color[solid].mean(0), rtol=0.01
    )
    assert rms(picture.color[solid] / distant.color[solid] - 1.0) < 0.05


@METHOD
@pytest.mark.parametrize(
    "size", [(1, 1), (2, 1), (1, 2), (3, 5), (5, 3), (7, 13), (63, 31)], ids=str
)
def test_panoramas_of_any_size_are_furnaces(
    device: ComputeDevice, method: tuple[str, str], size: tuple[int, int]
) -> None:
    """Amid even light a white ball is as bright as the rest, and nothing around it changes."""
    frame, white = sphere_frame(2.0, *size, 0.7), Material(albedo=(1.0, 1.0, 1.0))
    objects = [ball((0.2, -0.3, -1.0), 0.3, white)]
    view = SMALL if method is METHODS[size[0] % 2] else PANORAMA
    with Renderer(device, frame, objects, view, chosen(method)) as renderer:
        picture = renderer.render(3, AOVS)
        require_finite(renderer, [picture])
    assert (picture.aovs["coverage"] == 1.0).sum() > 10
    np.testing.assert_allclose(picture.color.mean((0, 1)), 0.7, rtol=0.02)
    assert np.percentile(np.abs(picture.color - 0.7), 95.0) < 0.05


# Time -----------------------------------------------------------------------------------------


def errors(picture: RenderedFrame, truth: RenderedFrame) -> dict[str, float]:
    """Return RMS errors of all pixels, of objects' pixels, and of the relighting ratio."""
    apart, solid = picture.color - truth.color, truth.aovs["coverage"] > 0.0
    ratio = picture.aovs["ratio"] - truth.aovs["ratio"]
    return {"all": rms(apart), "objects": rms(apart[solid]), "ratio": rms(ratio)}


@pytest.mark.thorough
@METHOD
def test_a_cut_of_the_video_leaves_nothing_behind(
    device: ComputeDevice, method: tuple[str, str]
) -> None:
    """Other light in another room: at once, and after eight frames, as if it had always been so."""
    objects = still_life()
    before = room_frame(replace(ROOM, solids=()), 256, 128, ceiling_lamp)
    after = room_frame(ROOM, 256, 128, bright_walls)
    sure: dict[str, Any] = {"fading": 0.0, "trace": {"rays": 8}}
    truth = render(device, after, objects, VIEW, chosen(method, seed=1, **sure), frames=16)
    with Renderer(device, after, objects, VIEW, chosen(method)) as renderer:
        fresh = [renderer.render(count, AOVS) for count in (1, 7)]
    with Renderer(device, before, objects, VIEW, chosen(method)) as renderer:
        old = renderer.render(16, AOVS)
        renderer.load(after)
        cut = [renderer.render(count, AOVS) for count in (1, 7)]
    for new, found in zip(fresh, cut, strict=True):
        least = errors(new, truth)
        for name, error in errors(found, truth).items():
            # 0.8 to 1.3 by the seed.
            assert error < 1.4 * least[name], name
        assert likeness(found.color, truth.color) > likeness(new.color, truth.color) - 0.01
    assert likeness(old.color, truth.color) < 0.5


@pytest.mark.thorough
@METHOD
def test_hundreds_of_frames_of_random_motion(
    device: ComputeDevice, method: tuple[str, str]
) -> None:
    """Turns, jumps, zooms and changes of the video; NaN would stay in a history until seen."""
    rng = np.random.default_rng(11)
    frames = [room_frame(ROOM, 64, 32, radiance) for radiance in (bright_walls, ceiling_lamp)]
    frames[1].color[3, 30] = 1e6
    settings, view = chosen(method), View(16, 12)
    with Renderer(device, frames[0], still_life(), view, settings) as renderer:
        for step in range(200):
            jump = rng.random() < 0.1
            yaw, pitch, fov = rng.normal(size=3) * (90.0 if jump else 2.0)
            view = replace(
                view,
                yaw_deg=view.yaw_deg + yaw,
                pitch_deg=float(np.clip(view.pitch_deg + pitch, -90.0, 90.0)),
                fov_y_deg=float(np.clip(view.fov_y_deg + fov, 2.0, 170.0)),
            )
            renderer.look(view)
            if step % 39 == 38:
                renderer.load(frames[(step // 39) % 2])
            renderer.step()
            if step % 50 == 49:
                require_finite(renderer, [renderer.render(0, AOVS)], str(step))
        assert any(values.any() for _, values in remembered(renderer))
