"""Pictures of scenes with lights without geometry: shadows, highlights, panes, motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.light import Light
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.meshes import transform
from tests.oracles.worlds import Box, World
from tests.raster.shapes import quad
from tests.rendering import render
from tests.trace.closed_forms import BLACK
from tests.trace.estimators import PLAIN, furnace
from tests.trace.virtual_lights import DOWN, from_point, lit_by
from tests.worlds import Float, ball, bright_walls, room_frame, sphere_frame

VIEW = View(64, 48, pitch_deg=-40.0, fov_y_deg=60.0)
WHITE = Material(albedo=(0.8, 0.8, 0.8))


def shown(
    device: ComputeDevice,
    *objects: Instance,
    frame: Frame | None = None,
    frames: int = 8,
    **chosen: object,
) -> RenderedFrame:
    """By default in a white sphere."""
    settings = Settings.model_validate({"fading": 0.0, "atrous": {"levels": 0}, **chosen})
    frame = frame or sphere_frame(2.0, 128, 64, 1.0)
    return render(device, frame, list(objects), VIEW, settings, frames)


HUNG = (0.0, -0.5, -1.0)
BOARD = transform(0.25 * DOWN, (0.0, -1.0, -1.0))


def beyond_board() -> tuple[Float, Float, Float]:
    """Points of the plain in `VIEW`, normals, and where light from `HUNG` has passed the board.

    The last is the larger coordinate from its middle, in half sides.
    """
    d = VIEW.directions()
    points = d * (PLAIN / d[..., 1:2])
    at_board = np.array(HUNG) + 0.5 * (points - np.array(HUNG))
    passed = np.abs((at_board - [0.0, -1.0, -1.0])[..., ::2]).max(axis=-1) / 0.25
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), points.shape)
    return points, up, passed


def test_light_ends_at_objects(device: ComputeDevice) -> None:
    """Behind a black board a point adds nothing, and its shadow has a sharp edge."""
    lamp = lit_by(Light("sphere", (0.5,) * 3), HUNG)
    board, plain = Instance("board", quad((BLACK,)), BOARD), furnace("plain")
    lit, unlit = (
        shown(device, *things, frame=plain, frames=32) for things in ((board, lamp), (board,))
    )
    points, up, passed = beyond_board()
    beside = lit.aovs["coverage"] == 0.0
    added = (lit.aovs["ratio"] - unlit.aovs["ratio"])[..., 0]
    hidden, free = beside & (passed < 0.9), beside & (passed > 1.1) & (points[..., 2] > -3.0)
    assert hidden.sum() > 30
    assert np.abs(added[hidden]).max() < 0.01
    wanted = 0.9 * 0.5 * from_point(points, up, HUNG) / np.pi
    assert wanted[free].max() > 0.09
    np.testing.assert_allclose(added[free], wanted[free], atol=0.01)


def test_light_ends_at_real_surfaces(device: ComputeDevice) -> None:
    """A board in a room shades the floor from a light above it, and nothing beside it."""
    world = World(solids=(Box((0.0, -0.8, -1.35), (0.5, 0.02, 0.35)),))
    frame = room_frame(world, 256, 128, bright_walls)
    lamp = lit_by(Light("sphere", (2.0,) * 3), (0.0, -0.3, -1.3))
    view = View(64, 64, pitch_deg=-55.0, fov_y_deg=80.0)
    settings = Settings.model_validate({"fading": 0.0})
    ratio = render(device, frame, [lamp], view, settings, 16).aovs["ratio"][..., 0]
    t, normal, _ = world.first_hit(np.zeros(3), view.directions())
    points = t[..., None] * view.directions()
    floor = (normal[..., 1] > 0.9) & (points[..., 1] < -1.2)
    up = np.array([0.0, -0.3, -1.3]) - points
    crossing = points + ((-0.8 - points[..., 1]) / up[..., 1])[..., None] * up
    off = np.abs(crossing - [0.0, 0.0, -1.35]) - [0.5, 9.0, 0.35]
    hidden = floor & (off.max(axis=-1) < -0.08)
    lit = floor & (off.max(axis=-1) > 0.08) & (np.linalg.norm(up, axis=-1) < 1.7)
    assert hidden.sum() > 20
    assert lit.sum() > 100
    # The walls pass light on, to both alike.
    assert np.median(ratio[lit]) - 1.0 > 3.0 * (np.median(ratio[hidden]) - 1.0)


def open_sky(radiance: float) -> Frame:
    plain = furnace("plain")
    color = np.full_like(plain.color, radiance)
    return replace(plain, depth=np.full_like(plain.depth, np.inf), color=color)


def test_a_light_is_not_seen(device: ComputeDevice) -> None:
    """Neither by the view nor in a mirror."""
    mirror = Material("conductor", (1.0, 1.0, 1.0), alpha=0.0)
    floor = Instance("mirror", quad((mirror,)), transform(0.8 * DOWN, (0.0, -1.0, -1.2)))
    lamp = lit_by(Light("sphere", (1e3,) * 3, radius=0.3), (0.0, -0.4, -1.5))
    lit, unlit = (
        shown(device, *things, frame=open_sky(1.0)) for things in ((floor, lamp), (floor,))
    )
    np.testing.assert_array_equal(lit.color, unlit.color)
    np.testing.assert_array_equal(lit.aovs["coverage"], unlit.aovs["coverage"])


@pytest.mark.thorough
def test_dark_lights_change_nothing(device: ComputeDevice) -> None:
    thing = ball((0.0, -0.9, -0.9), 0.2, WHITE)
    dark = [lit_by(Light("sphere", (0.0,) * 3)), lit_by(Light("rectangle", (0.0,) * 3), name="b")]
    picture = shown(device, *dark)
    np.testing.assert_array_equal(picture.aovs["ratio"], 1.0)
    with_thing = shown(device, thing, *dark, frames=48)
    alone = shown(device, thing, frames=48)
    assert with_thing.color.mean() == pytest.approx(alone.color.mean(), rel=5e-3)


def test_a_highlight_has_the_brightness_of_the_lobe(device: ComputeDevice) -> None:
    """On a rough metal below a point in the view's axis: D F G / (4 cos cos) times I / d²."""
    alpha = 0.4
    metal = Material("conductor", (1.0, 0.6, 0.3), alpha=alpha)
    floor = Instance("metal", quad((metal,)), transform(0.7 * np.eye(3), (0.0, 0.0, -1.5)))
    lamp = lit_by(Light("sphere", (1.0,) * 3), (0.0, 0.3, -0.7), np.eye(3))
    view = View(48, 48, fov_y_deg=30.0)
    settings = Settings.model_validate(
        {"fading": 0.0, "atrous": {"levels": 0}, "trace": {"jitter": False}}
    )
    picture = render(device, open_sky(1e-6), [floor, lamp], view, settings, 32)
    d = view.directions()
    points = d * (-1.5 / d[..., 2:])
    i, o = np.array([0.0, 0.3, -0.7]) - points, -points
    distance2 = (i**2).sum(-1)
    i /= np.linalg.norm(i, axis=-1, keepdims=True)
    o /= np.linalg.norm(o, axis=-1, keepdims=True)
    h = i + o
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    a2 = alpha**2
    ggx = a2 / (np.pi * (1.0 + (a2 - 1.0) * h[..., 2] ** 2) ** 2)
    slope_i, slope_o = (np.sqrt(a2 + (1.0 - a2) * v[..., 2] ** 2) for v in (i, o))
    visible = 0.5 / (slope_i * o[..., 2] + slope_o * i[..., 2])  # G2 / (4 cos cos)
    wanted = (ggx * visible * i[..., 2] / distance2)[..., None] * np.array([1.0, 0.6, 0.3])
    np.testing.assert_allclose(picture.color, wanted, rtol=0.05, atol=1e-3 * wanted.max())
    assert picture.color.mean() == pytest.approx(wanted.mean(), rel=3e-3)


def through_pane(points: Float) -> Float:
    """Share of light from `HUNG` that crosses a level pane of index 1.5 (Fresnel)."""
    away = np.array(HUNG) - points
    cosine = away[:, 1] / np.linalg.norm(away, axis=-1)
    root = np.sqrt(1.5**2 - 1.0 + cosine**2)
    s, p = (cosine - root) / (cosine + root), (2.25 * cosine - root) / (2.25 * cosine + root)
    reflected = 0.5 * (s * s + p * p)
    return np.asarray(1.0 - 2.0 * reflected / (1.0 + reflected))


@pytest.mark.thorough
@pytest.mark.parametrize("glazed", [False, True])
def test_a_board_behind_a_light_does_not_shade(device: ComputeDevice, glazed: bool) -> None:
    """Just above the light, which shines down, or through a pane just below it."""
    lamp = lit_by(Light("sphere", (0.5,) * 3), HUNG)
    black = Instance("board", quad((BLACK,)), transform(0.25 * DOWN, (0.0, -0.4, -1.0)))
    glass = Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0, thin=True)
    pane = Instance("pane", quad((glass,)), transform(0.25 * DOWN, (0.0, -0.7, -1.0)))
    things, plain = [black, *([pane] if glazed else [])], furnace("plain")
    lit, unlit = (shown(device, *t, frame=plain, frames=64) for t in ((*things, lamp), things))
    points, up, _ = beyond_board()
    below = np.abs((points - np.array(HUNG))[..., ::2]).max(axis=-1) < 0.4
    below &= lit.aovs["coverage"] == 0.0
    assert below.sum() > 30
    added = (lit.aovs["ratio"] - unlit.aovs["ratio"])[below][:, 0]
    wanted = 0.9 * 0.5 * from_point(points, up, HUNG)[below] / np.pi
    wanted *= through_pane(points[below]) if glazed else 1.0
    # What replaces light that the board hides is reflected as well as that, not by 0.9.
    assert added.mean() == pytest.approx(wanted.mean(), rel=0.08)


@pytest.mark.thorough
def test_light_goes_straight_through_panes(device: ComputeDevice) -> None:
    """A pane of index 1.5 reflects 2 R / (1 + R) of it, with R of one surface."""
    pane = Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0, thin=True)
    lamp = lit_by(Light("sphere", (0.5,) * 3), HUNG)
    glass, plain = Instance("pane", quad((pane,)), BOARD), furnace("plain")
    glazed, unlit = (
        shown(device, *things, frame=plain, frames=64) for things in ((glass, lamp), (glass,))
    )
    points, up, passed = beyond_board()
    behind = (glazed.aovs["coverage"] == 0.0) & (passed < 0.9)
    assert behind.sum() > 30
    added = (glazed.aovs["ratio"] - unlit.aovs["ratio"])[behind][:, 0]
    share = through_pane(points[behind])
    wanted = 0.9 * 0.5 * share * from_point(points, up, HUNG)[behind] / np.pi
    assert added.mean() == pytest.approx(wanted.mean(), rel=0.02)
    assert wanted.mean() < 0.94 * (wanted / share).mean()


@pytest.mark.thorough
def test_surfaces_pass_light_on(device: ComputeDevice) -> None:
    """Inside a white sphere all receive the mean of the reflected light, any number of times."""
    lamp = lit_by(Light("sphere", (0.4,) * 3), (0.0, 0.0, 0.0))
    picture = shown(device, lamp, frames=150, fading=1.0)
    direct = 0.4 / 2.0**2 / np.pi
    assert picture.aovs["ratio"].mean() - 1.0 == pytest.approx(0.9 * direct / (1.0 - 0.9), rel=0.05)


@pytest.mark.thorough
def test_lights_move(device: ComputeDevice) -> None:
    """A renderer whose light has moved converges to the picture of one that is there."""
    thing = ball((0.0, -1.2, -0.9), 0.2, WHITE)
    light = Light("sphere", (0.5,) * 3, cone_deg=(20.0, 30.0))
    there, here = lit_by(light, (0.3, -0.3, -0.9)), lit_by(light, (-0.3, -0.3, -0.9))
    frame = sphere_frame(2.0, 128, 64, 1.0)
    with Renderer(device, frame, [thing, there], VIEW) as renderer:
        renderer.render(8)
        renderer.move([thing, here])
        moved = renderer.render(48).color
    fresh = render(device, frame, [thing, here], VIEW, Settings(), 48).color
    before = render(device, frame, [thing, there], VIEW, Settings(), 48).color
    assert np.abs(before - fresh).max() > 0.2
    assert np.abs(moved - fresh).mean() < 0.02


def test_lights_at_extremes_stay_finite(device: ComputeDevice) -> None:
    """In the surface, at the capture centre, inside of an object, huge, tiny, blinding."""
    thing = ball((0.0, -0.9, -0.9), 0.2, WHITE)
    lamps = [
        lit_by(Light("sphere", (1e6,) * 3), (0.0, -2.0, 0.0), name="in the floor"),
        lit_by(Light("sphere", (1.0,) * 3, radius=5.0), (0.0, 0.0, 0.0), name="around all"),
        lit_by(Light("sphere", (1.0,) * 3), (0.0, -0.9, -0.9), name="inside"),
        lit_by(Light("rectangle", (1.0,) * 3, size=(1e-6, 1e3)), name="thread"),
        lit_by(Light("sun", (1e6,) * 3, diameter_deg=0.0), name="sun"),
        lit_by(Light("sphere", (1e-30,) * 3), (0.0, -0.7, -0.9), np.zeros((3, 3)), name="flat"),
    ]
    picture = shown(device, thing, *lamps, frames=4)
    assert np.isfinite(picture.color).all()
    assert picture.color.min() >= 0.0
