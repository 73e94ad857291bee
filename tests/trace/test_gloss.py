"""Objects in the reflections of glossy real surfaces: mirrors, furnaces, unchanged pixels."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.plan import PlanDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.frame.whole_frame import BRASS, SATIN
from tests.oracles.worlds import Sphere, World
from tests.rendering import render
from tests.world.real.test_highlight import partly_seen_floor
from tests.worlds import Float, ball, bright_walls, room_frame, sphere_frame

ROOM = World()
FLOOR = ROOM.low[1]
REFLECTANCE = (0.9, 0.7, 0.5)
MIRROR = Material("conductor", REFLECTANCE, alpha=0.0)
COAT = Material("plastic", alpha=0.2)
BLACK = Material(albedo=(0.0, 0.0, 0.0))
BALL = Sphere((0.2, FLOOR + 0.45, -1.5), 0.3)
DOWN = View(96, 72, pitch_deg=-35.0)


def settings(**others: Any) -> Settings:
    return Settings.model_validate({"fading": 0.0, **others})


def render_with_specks(
    device: ComputeDevice,
    frame: Frame,
    instances: list[Instance],
    view: View = DOWN,
    frames: int = 1,
    chosen: Settings | None = None,
) -> RenderedFrame:
    # With a window and buried specks of all materials, kernels are those of other tests.
    opening = np.zeros(frame.depth.shape, bool)
    opening[frame.height // 8, :2] = True
    specks = [
        ball((0.1 * i, FLOOR - 1.0, -1.5), 0.01, material, subdivisions=1)
        for i, material in enumerate((BLACK, SATIN, MIRROR, BRASS))
    ]
    frame, instances = replace(frame, opening=opening), [*instances, *specks]
    return render(device, frame, instances, view, chosen or settings(), frames)


def with_floor(frame: Frame, material: Material) -> Frame:
    gloss = (frame.normal[..., 1] > 0.5).astype(np.uint8)
    # The second has no texel: floors of either kind have one build of the kernels.
    unused = COAT if material.kind == "conductor" else MIRROR
    return replace(frame, gloss=gloss, real_materials=(material, unused))


def mirror_room(width: int = 512, height: int = 256) -> Frame:
    """Bright walls over a floor that is a mirror: its texels hold the reflected light."""
    frame = with_floor(room_frame(ROOM, width, height, bright_walls), MIRROR)
    d = View(width, height, projection="equirect").directions()
    floor = frame.gloss == 1
    color = frame.color.copy()
    points = d[floor] * frame.depth[floor][:, None]
    color[floor] = np.array(REFLECTANCE) * wall_light(points, d[floor] * (1.0, -1.0, 1.0))
    return replace(frame, color=color)


def wall_light(points: Float, d: Float) -> Float:
    t, normal, _ = ROOM.first_hit(points, d)
    return bright_walls(points + t[..., None] * d, normal)


def floor_rays(view: View) -> tuple[NDArray[np.bool_], Float, Float]:
    """Return the pixels that see the floor past the ball; (H, W, 3) points, mirrored directions."""
    d = view.directions()
    t, normal, _ = ROOM.first_hit(np.zeros(3), d)
    enter, leave, _, _ = BALL.interval(np.zeros(3), d)
    seen = (normal[..., 1] > 0.5) & ~((enter < leave) & (leave > 0.0))
    return seen, t[..., None] * d, d * (1.0, -1.0, 1.0)


# Mirrors --------------------------------------------------------------------------------------


def test_a_mirror_floor_shows_the_ball_upside_down(device: ComputeDevice) -> None:
    """A black ball hides what was reflected; beside its mirror image, no bit changes."""
    picture = render_with_specks(device, mirror_room(), [ball(BALL.centre, BALL.radius, BLACK)])
    seen, points, mirrored = floor_rays(DOWN)
    enter, leave, _, _ = BALL.interval(points, mirrored)
    depth = np.where(leave > enter, leave - enter, 0.0)
    hidden = seen & (depth > 0.15 * BALL.radius) & (enter > 0.0)
    clear = seen & (depth == 0.0) & (distance_to_ball(points, mirrored) > 1.1 * BALL.radius)
    background = picture.aovs["background"]
    # Where the wall meets the floor, a texel may be either.
    mirror = (picture.aovs["highlight"] == background).all(-1)
    assert mirror[seen & (picture.aovs["coverage"] == 0.0)].mean() > 0.98
    clear &= mirror & (picture.aovs["coverage"] == 0.0)
    assert hidden.sum() > 100
    assert clear.sum() > 1000
    black = (picture.color[hidden] < 0.03 * background[hidden]).all(-1)
    assert black.mean() > 0.98
    np.testing.assert_array_equal(picture.color[clear], background[clear])


def test_a_mirror_ball_over_a_mirror_floor(device: ComputeDevice) -> None:
    """Twice mirrored, the walls show where numpy finds them."""
    tint = np.array((0.8, 0.9, 0.6))
    shiny = Material("conductor", tuple(tint), alpha=0.0)
    view = View(128, 96, pitch_deg=-35.0)
    picture = render_with_specks(
        device, mirror_room(), [ball(BALL.centre, BALL.radius, shiny, subdivisions=6)], view
    )
    seen, points, mirrored = floor_rays(view)
    enter, leave, normal, _ = BALL.interval(points, mirrored)
    hit = seen & (leave > enter) & (enter > 0.0)
    at = points + np.where(hit, enter, 0.0)[..., None] * mirrored
    onward = mirrored - 2.0 * (mirrored * normal).sum(-1, keepdims=True) * normal
    onward = np.where(hit[..., None], onward, mirrored)
    _, wall, _ = ROOM.first_hit(at, onward)
    hit &= wall[..., 1] < 0.5  # the floor shows what it reflects towards the camera only
    hit &= -(mirrored * normal).sum(-1) > 0.3  # edges of the ball compress the room
    assert hit.sum() > 100
    expected = np.array(REFLECTANCE) * tint * wall_light(at, onward)
    error = np.abs(picture.color - expected)[hit].max(-1) / expected[hit].max(-1)
    assert np.median(error) < 0.03
    assert (error < 0.1).mean() > 0.85


def distance_to_ball(points: Float, d: Float) -> Float:
    """The distance of the rays' lines from the ball's centre."""
    apart = np.array(BALL.centre) - points
    return np.asarray(np.linalg.norm(apart - (apart * d).sum(-1, keepdims=True) * d, axis=-1))


# Coats ----------------------------------------------------------------------------------------


def test_furnace(device: ComputeDevice) -> None:
    """A white object changes nothing in even light, reflected or not."""
    frame = sphere_frame(2.0, 128, 64, 0.7)
    below = View(128, 64, projection="equirect").directions()[..., 1] < -0.5
    frame = replace(frame, gloss=below.astype(np.uint8), real_materials=(COAT,))
    white = Material(albedo=(1.0, 1.0, 1.0))
    picture = render_with_specks(device, frame, [ball((0.0, -1.0, -0.9), 0.3, white)], frames=24)
    beside = picture.aovs["coverage"] == 0.0
    assert np.abs(picture.aovs["highlight"])[beside].max() > 0.02
    # The change of the reflection, of 0.7 times at least 4%.
    assert np.abs(picture.aovs["gloss"][beside]).max() < 0.007
    np.testing.assert_allclose(picture.color[beside], 0.7, rtol=0.03)


def test_a_coat_reflects_a_bright_object_and_hides_a_bright_wall(device: ComputeDevice) -> None:
    """ΔS has the sign of what is gained: dark objects darken, glowing ones would brighten."""
    frame = with_floor(room_frame(ROOM, 256, 128, bright_walls), COAT)
    frame = replace(frame, color=np.where(frame.gloss[..., None] == 1, 0.3, 3.0 * frame.color))
    frame = replace(frame, color=frame.color.astype(np.float32))
    dark = render_with_specks(device, frame, [ball(BALL.centre, BALL.radius, BLACK)], frames=8)
    change = dark.aovs["gloss"]
    assert change.max() <= 1e-6
    assert change.min() < -0.02
    # No more is lost than was there.
    assert (change + dark.aovs["highlight"])[dark.aovs["coverage"] == 0.0].min() > -0.05
    assert (dark.color >= 0.0).all()
    silver = Material("conductor", (1.0, 1.0, 1.0), alpha=0.0)
    light = render_with_specks(device, frame, [ball(BALL.centre, BALL.radius, silver)], frames=8)
    assert light.aovs["gloss"].mean() > change.mean()


def test_what_was_not_seen_cannot_be_hidden(device: ComputeDevice) -> None:
    """A black ball hides what a floor mirrors, but not where the camera saw no mirror image."""
    black = [ball(BALL.centre, BALL.radius, BLACK)]

    def hidden(unseen: NDArray[np.int64]) -> float:
        picture = render_with_specks(device, partly_seen_floor(unseen)[0], black, frames=4)
        return float(-picture.aovs["gloss"][picture.aovs["coverage"] == 0.0].min())

    ahead = np.arange(104, 152)
    behind = hidden((ahead + 128) % 256)
    assert behind > 1.0
    assert hidden(ahead) < 0.6 * behind


def test_without_influence_pixels_keep_their_bits(device: ComputeDevice) -> None:
    frame = with_floor(room_frame(ROOM, 256, 128, bright_walls), COAT)
    buried = ball((0.0, FLOOR - 1.0, -1.5), 0.3, BLACK)
    picture = render_with_specks(device, frame, [buried], frames=2)
    same = (picture.aovs["gloss"] == 0.0).all(-1) & (picture.aovs["ratio"] == 1.0).all(-1)
    assert same.mean() > 0.3
    assert picture.aovs["highlight"][same].any()
    np.testing.assert_array_equal(picture.color[same], picture.aovs["background"][same])


def test_highlights_take_no_shadow(device: ComputeDevice) -> None:
    """A conductor is not diffuse: no ratio darkens it."""
    frame = mirror_room(256, 128)
    picture = render_with_specks(device, frame, [ball(BALL.centre, BALL.radius, BLACK)], frames=4)
    seen, _, _ = floor_rays(DOWN)
    plain = seen & (picture.aovs["gloss"] == 0.0).all(-1) & (picture.aovs["coverage"] == 0.0)
    plain &= (picture.aovs["highlight"] == picture.aovs["background"]).all(-1)
    shadowed = plain & (picture.aovs["ratio"] < 0.95).all(-1)
    assert shadowed.sum() > 50
    np.testing.assert_array_equal(picture.color[shadowed], picture.aovs["background"][shadowed])


# Features ---------------------------------------------------------------------------------


def plan(frame: Frame, chosen: Settings | None = None) -> PlanDevice:
    device = PlanDevice()
    Renderer(device, frame, [ball(BALL.centre, 0.3, BLACK, subdivisions=1)], DOWN, chosen)
    return device


GLOSS_KERNELS = {
    "filter_sites",
    "trace_gloss",
    "diffuse_part",
    "resample_glossy",
    "resample_highlight",
    "sharpen_glossy",
}


def test_nothing_is_built_without_real_materials() -> None:
    frame = room_frame(ROOM, 64, 32, bright_walls)
    device = plan(frame)
    assert "GLOSS" not in {define for one in device.kernels for define in one.defines}
    assert not GLOSS_KERNELS & {one.name for one in device.kernels}
    words = ("gloss", "highlight", "radiated", "reflectance", "real diffuse", "real roughness")
    assert not [name for name in device.buffers for word in words if word in name]
    # Nor where the real surfaces are not relit at all.
    distant = plan(with_floor(frame, COAT), settings(method="ibl"))
    assert {name: distant.buffers[name] for name in distant.buffers} == (
        plan(frame, settings(method="ibl")).buffers
    )


def test_real_materials_build_what_finds_their_reflections() -> None:
    frame = room_frame(ROOM, 64, 32, bright_walls)
    device = plan(replace(with_floor(frame, COAT), real_materials=(COAT,)))
    assert {one.name for one in device.kernels} >= GLOSS_KERNELS
    (gloss,) = [one.defines for one in device.kernels if one.file == "trace/trace_gloss.cl"]
    assert "GLOSS" in gloss
