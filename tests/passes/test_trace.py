"""Light in the frame: real surfaces and virtual ones against furnaces, rooms and Monte Carlo."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.camera import View
from iprt.scene.frame import Frame
from iprt.scene.material import Material
from iprt.scene.mesh import Instance
from iprt.settings import Settings
from tests.oracles.brdf import diffuse_albedo, specular_albedo
from tests.oracles.worlds import Sphere, World
from tests.worlds import Float, ball, bright_walls, ceiling_lamp, cuboid, room_frame, sphere_frame

ROOM = World()
FLOOR = ROOM.low[1]
DOWN = View(96, 72, pitch_deg=-35.0)
PANORAMA = View(256, 128, projection="equirect")
BLACK = Material(albedo=(0.0, 0.0, 0.0))
MIRROR = Material("conductor", (0.9, 0.8, 0.7), alpha=0.0)

# As traced, without the spatial filter: what remains is noise, which averages out.
RAW: dict[str, Any] = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}


ESTIMATORS = ["delta", "ratio"]


def settings(
    rays: int = 1, relit: bool = False, estimator: str = "delta", **others: Any
) -> Settings:
    """Rays of objects start at the pixels' centres, which is where truth is known."""
    trace = {
        "rays": rays, "relight_reflections": relit, "estimator": estimator, "jitter": False
    }  # fmt: skip
    return Settings.model_validate({"fading": 0.0, "trace": trace, **others})


def render(
    device: ComputeDevice,
    frame: Frame,
    instances: list[Instance],
    view: View,
    chosen: Settings,
    frames: int = 1,
) -> RenderedFrame:
    aovs = ("coverage", "ratio", "normal", "irradiance_real", "irradiance_mixed", "specular")
    with Renderer(device, frame, instances, view, chosen) as renderer:
        return renderer.render(frames, aovs)


# White furnace -------------------------------------------------------------------------------

RADIANCE = 0.7
BALL = Sphere((0.3, -0.2, -1.0), 0.35)
FURNACE_VIEWS = [View(64, 48), View(128, 64, projection="equirect")]


def furnace(
    device: ComputeDevice, material: Material, view: View, frames: int, estimator: str = "delta"
) -> tuple[RenderedFrame, NDArray[np.bool_]]:
    frame = sphere_frame(2.0, 128, 64, RADIANCE)
    objects = [ball(BALL.centre, BALL.radius, material)]
    picture = render(device, frame, objects, view, settings(estimator=estimator), frames)
    inside = picture.aovs["coverage"] == 1.0
    assert inside.sum() > 80
    return picture, inside


@pytest.mark.parametrize("view", FURNACE_VIEWS, ids=lambda view: view.projection)
@pytest.mark.parametrize(
    "material",
    [Material(albedo=(0.8, 0.5, 0.2)), MIRROR],
    ids=["diffuse", "mirror"],
)
def test_furnace_shows_the_reflectance(
    device: ComputeDevice, material: Material, view: View
) -> None:
    """What is lit evenly from all sides shines with its albedo: no ray meets the object itself."""
    picture, inside = furnace(device, material, view, frames=2)
    np.testing.assert_allclose(
        picture.color[inside], np.tile(RADIANCE * np.array(material.albedo), (inside.sum(), 1)),
        rtol=1e-5,
    )  # fmt: skip


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("view", FURNACE_VIEWS, ids=lambda view: view.projection)
def test_furnace_lights_real_surfaces_evenly(
    device: ComputeDevice, view: View, estimator: str
) -> None:
    picture, _ = furnace(device, BLACK, view, 3, estimator)
    irradiance = picture.aovs["irradiance_real"]
    if estimator == "delta":  # known where an object matters
        known = irradiance[..., 0] > 0.0
        assert known[picture.aovs["ratio"].min(-1) < 0.99].all()
        assert known.mean() > 0.2
        irradiance = irradiance[known]
    np.testing.assert_allclose(irradiance, RADIANCE, rtol=2e-6)
    assert picture.aovs["irradiance_mixed"].max() <= RADIANCE * (1.0 + 2e-6)


@pytest.mark.parametrize(
    "material",
    [
        Material("conductor", (0.9, 0.6, 0.3), alpha=0.3),
        Material("plastic", (0.8, 0.5, 0.2), alpha=0.2),
    ],
    ids=["conductor", "plastic"],
)
def test_furnace_loses_what_the_brdf_loses(device: ComputeDevice, material: Material) -> None:
    """Radiance by viewing angle is the albedo by quadrature, and never more than the furnace's."""
    view = FURNACE_VIEWS[0]
    picture, inside = furnace(device, material, view, frames=48)
    cosine = seen_cosine(view, BALL)
    for low, high in ((0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.0)):
        ring = inside & (cosine > low) & (cosine < high)
        mid = float(cosine[ring].mean())
        o = np.array([np.sqrt(1.0 - mid * mid), 0.0, mid])
        albedo = specular_albedo(material, o)
        if material.kind == "plastic":
            albedo = albedo + np.array(material.albedo) * diffuse_albedo(material, o)
        shown = picture.color[ring].mean(0) / RADIANCE
        np.testing.assert_allclose(shown, albedo, rtol=0.02)
        assert (shown < 1.0).all()


def seen_cosine(view: View, solid: Sphere) -> Float:
    """Cosine between the ball's normal and the direction to the camera; 0 beside it."""
    return mirror_rays(view, solid)[2]


def mirror_rays(view: View, solid: Sphere) -> tuple[Float, Float, Float]:
    """Points on a ball seen through pixels, mirror directions there, cosines (0: beside it)."""
    d = view.directions()
    t, _, normal, _ = solid.interval(np.zeros(d.shape), d)
    seen = np.isfinite(t)
    point = np.where(seen, t, 1.0)[..., None] * d
    cosine = np.where(seen, -(normal * d).sum(-1), 0.0)
    return point, np.where(seen[..., None], d + 2.0 * cosine[..., None] * normal, d), cosine


# Shadows and bounce light --------------------------------------------------------------------


def floor_point(view: View, shape: tuple[int, ...]) -> Float:
    """(H, W, 3) where the pixels see the floor plane; far away above the horizon."""
    d = np.broadcast_to(view.directions(), shape)
    return np.asarray(d * (FLOOR / np.minimum(d[..., 1], -1e-3))[..., None])


def floor_block(view: View, row: int, column: int, count: int) -> Float:
    """(count, 3) floor points that the 3 x 3 pixels about a pixel see, evenly over them."""
    block = View(
        3 * view.width, 3 * view.height, view.yaw_deg, view.pitch_deg, fov_y_deg=view.fov_y_deg
    )
    rows, columns = (slice(3 * at - 3, 3 * at + 6) for at in (row, column))
    d = np.resize(block.directions()[rows, columns].reshape(-1, 3), (count, 3))
    return np.asarray(d * (FLOOR / d[:, 1:2]))


def floor_light(
    points: Float, solid: Sphere, albedo: tuple[float, float, float]
) -> tuple[Float, Float]:
    """(3,) E_R / π and E_RV / π, means over (N, 3) floor points, by Monte Carlo in the true room.

    The ball is Lambertian and convex, so light reaches the floor by way of it in one bounce.
    """
    rng = np.random.default_rng(5)

    def cosine_about(normal: Float) -> Float:
        d = rng.normal(size=normal.shape)
        d = normal + d / np.linalg.norm(d, axis=-1, keepdims=True)
        return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))

    def room_light(o: Float, d: Float) -> Float:
        t, normal, _ = ROOM.first_hit(o, d)
        return ceiling_lamp(o + t[..., None] * d, normal)

    o = points + np.array([0.0, 1e-6, 0.0])
    d = cosine_about(np.broadcast_to([0.0, 1.0, 0.0], o.shape))
    seen = room_light(o, d)
    enter, leave, normal, _ = solid.interval(o, d)
    met = np.isfinite(enter) & (leave > 0.0)
    both = seen.copy()
    on_ball = o[met] + enter[met, None] * d[met] + 1e-6 * normal[met]
    both[met] = np.array(albedo) * room_light(on_ball, cosine_about(normal[met]))
    return seen.mean(0), both.mean(0)


def floor_truth(
    view: View,
    row: NDArray[np.integer],
    column: NDArray[np.integer],
    solid: Sphere,
    albedo: tuple[float, float, float],
) -> tuple[Float, Float]:
    """(N, 3) E_R / π and E_RV / π of pixels, each over a 3 x 3 block."""
    blocks = [floor_block(view, *at, 150_000) for at in zip(row, column, strict=True)]
    real, mixed = zip(*(floor_light(block, solid, albedo) for block in blocks), strict=True)
    return np.array(real), np.array(mixed)


def means3(image: NDArray[np.floating]) -> Float:
    """3 x 3 means of the inner pixels."""
    h, w = image.shape[:2]
    nine = [image[y : h - 2 + y, x : w - 2 + x] for y in range(3) for x in range(3)]
    return np.asarray(np.mean(nine, axis=0), np.float64)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("filtered", [False, True], ids=["raw", "filtered"])
@pytest.mark.parametrize(
    "albedo", [(0.0, 0.0, 0.0), (0.9, 0.5, 0.1)], ids=["black ball", "red ball"]
)
def test_floor_below_a_ball_matches_monte_carlo(
    device: ComputeDevice, albedo: tuple[float, float, float], filtered: bool, estimator: str
) -> None:
    """Along a line through the shadow's middle: umbra, penumbra, and the light that bounces."""
    solid = Sphere((0.2, FLOOR + 0.45, -1.4), 0.3)
    objects = [ball(solid.centre, solid.radius, Material(albedo=albedo))]
    chosen = settings(rays=8, estimator=estimator, **({} if filtered else RAW))
    frame = room_frame(ROOM, 512, 256, ceiling_lamp)
    picture = render(device, frame, objects, DOWN, chosen, frames=16)
    x = solid.centre[0] + np.array([-0.55, -0.4, -0.2, 0.0, 0.2, 0.4, 0.55, 0.9])
    line = np.stack([x, np.full_like(x, FLOOR), np.full_like(x, -1.4)], axis=-1)
    column, row = np.floor(DOWN.project(line)).astype(int).T
    real, mixed = floor_truth(DOWN, row, column, solid, albedo)

    def shown(name: str) -> Float:
        return np.asarray(means3(picture.aovs[name])[row - 1, column - 1])

    tolerance = 0.09 if filtered else 0.06
    np.testing.assert_allclose(shown("irradiance_real"), real, rtol=0.06)
    np.testing.assert_allclose(shown("irradiance_mixed"), mixed, atol=tolerance * real.max())
    np.testing.assert_allclose(shown("ratio"), mixed / real, atol=tolerance)
    assert (mixed / real)[3].max() < 0.4  # the test has an umbra
    assert abs(shown("ratio")[-1] - 1.0).max() < 0.02


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_contact_is_dark_and_distance_is_light(device: ComputeDevice, estimator: str) -> None:
    solid = Sphere((0.2, FLOOR + 0.3, -1.4), 0.3)
    objects = [ball(solid.centre, solid.radius, BLACK)]
    frame = room_frame(ROOM, 512, 256, ceiling_lamp)
    chosen = settings(rays=8, estimator=estimator, **RAW)
    ratio = render(device, frame, objects, DOWN, chosen, 8).aovs["ratio"]
    floor = floor_point(DOWN, ratio.shape)
    away = np.hypot(floor[..., 0] - 0.2, floor[..., 2] + 1.4)
    assert ratio[away < 0.06].mean() < 0.05
    on_floor = (floor[..., 1] > FLOOR - 1e-3) & (np.abs(floor[..., 2]) < 2.4)
    assert ratio[on_floor & (away > 1.1) & (np.abs(floor[..., 0]) < 1.9)].min() > 0.97


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_objects_off_screen_cast_shadows(device: ComputeDevice, estimator: str) -> None:
    """The view's edge cuts the ball off, not its shadow."""
    solid = Sphere((0.2, FLOOR + 0.45, -1.4), 0.3)
    objects = [ball(solid.centre, solid.radius, BLACK)]
    frame = room_frame(ROOM, 512, 256, ceiling_lamp)
    view = View(48, 48, yaw_deg=-24.0, pitch_deg=-46.0, fov_y_deg=30.0)
    chosen = settings(rays=16, estimator=estimator, **RAW)
    picture = render(device, frame, objects, view, chosen, 16)
    assert not picture.aovs["coverage"].any()
    row, column = np.array([(4, 44), (20, 44), (36, 40), (20, 24), (40, 8)]).T
    real, mixed = floor_truth(view, row, column, solid, (0.0, 0.0, 0.0))
    assert (mixed / real).min() < 0.75
    shown = means3(picture.aovs["ratio"])[row - 1, column - 1]
    np.testing.assert_allclose(shown, mixed / real, atol=0.05)


# Reflections ---------------------------------------------------------------------------------

MIRROR_BALL = Sphere((0.2, -0.3, -1.4), 0.4)


def wall_light(o: Float, d: Float) -> tuple[Float, NDArray[np.bool_]]:
    """What rays see of the walls, and whether it is clear of the edges between them."""
    t, normal, _ = ROOM.first_hit(o, d)
    point = o + t[..., None] * d
    gaps = np.minimum(point - ROOM.low, np.asarray(ROOM.high) - point)
    return bright_walls(point, normal), np.sort(gaps, axis=-1)[..., 1] > 0.06


@pytest.mark.parametrize("view", [View(96, 72), PANORAMA], ids=lambda view: view.projection)
@pytest.mark.parametrize("method", ["iprt", "ibl"])
def test_mirror_ball_shows_the_room(device: ComputeDevice, method: str, view: View) -> None:
    """From the ball's surface with parallax; from the capture centre where all is far away."""
    frame = room_frame(ROOM, 256, 128, bright_walls)
    objects = [ball(MIRROR_BALL.centre, MIRROR_BALL.radius, MIRROR)]
    picture = render(device, frame, objects, view, settings(method=method))
    point, d, cosine = mirror_rays(view, MIRROR_BALL)
    parallax, clear = wall_light(point, d)
    distant, clear_far = wall_light(np.zeros_like(point), d)
    wanted, other = (parallax, distant) if method == "iprt" else (distant, parallax)
    inner = (picture.aovs["coverage"] == 1.0) & (cosine > 0.3) & clear & clear_far
    assert inner.sum() > 150
    wanted, other = wanted[inner] * MIRROR.albedo, other[inner] * MIRROR.albedo
    right = (np.abs(picture.color[inner] - wanted) < 0.03 * wanted.max(-1, keepdims=True)).all(-1)
    assert right.mean() > 0.95
    # The two would not be confused.
    assert (np.abs(wanted - other).max(-1) > 0.1).mean() > 0.2


@pytest.mark.parametrize(
    "centre", [(-0.55, -0.2, -0.9), (1.3, -0.2, -0.5)], ids=["on screen", "off screen"]
)
def test_mirror_ball_shows_other_objects(
    device: ComputeDevice, centre: tuple[float, float, float]
) -> None:
    """Mirror rays that truly meet a black ball are black, those that miss it are not."""
    view = View(144, 108)
    black = Sphere(centre, 0.3)
    objects = [ball(MIRROR_BALL.centre, MIRROR_BALL.radius, MIRROR), ball(centre, 0.3, BLACK)]
    frame = room_frame(ROOM, 256, 128, bright_walls)
    picture = render(device, frame, objects, view, settings())
    point, d, cosine = mirror_rays(view, MIRROR_BALL)
    normal = (point - MIRROR_BALL.centre) / MIRROR_BALL.radius

    def met(radius: float) -> NDArray[np.bool_]:
        enter, _, _, _ = Sphere(centre, radius).interval(point, d)
        return np.asarray(np.isfinite(enter) & (enter > 0.0))

    first = black.interval(np.zeros_like(d), view.directions())[0]
    is_mirror = ~(np.isfinite(first)) & (picture.aovs["coverage"] == 1.0) & (cosine > 0.3)
    is_mirror &= np.linalg.norm(normal, axis=-1) < 1.01
    inside, outside = is_mirror & met(0.24), is_mirror & ~met(0.36)
    assert inside.sum() > 15
    dark = picture.color.max(-1) < 0.01
    assert dark[inside].mean() > 0.95
    assert dark[outside].mean() < 0.01


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_reflections_are_relit_when_asked(device: ComputeDevice, estimator: str) -> None:
    """A mirror ball shows the shadow of a box on the floor, as dark as the floor itself."""
    mirror = Sphere((0.45, FLOOR + 0.4, -1.7), 0.4)
    objects = [
        ball(mirror.centre, mirror.radius, MIRROR),
        cuboid((-0.35, FLOOR + 0.45, -1.5), (0.2, 0.2, 0.2), BLACK),
    ]
    frame = room_frame(ROOM, 512, 256, ceiling_lamp)
    view = View(128, 96, pitch_deg=-35.0)
    on, off = (
        render(device, frame, objects, view, settings(4, relit, estimator), 8)
        for relit in (True, False)
    )
    # The map of what is out of view has E_R refined in more places.
    same = 2e-2 if estimator == "delta" else 0.0
    np.testing.assert_allclose(on.aovs["ratio"], off.aovs["ratio"], atol=same)
    point, d, cosine = mirror_rays(view, mirror)
    t, normal, _ = ROOM.first_hit(point, d)
    reflected = point + t[..., None] * d
    box_seen = np.linalg.norm(on.aovs["normal"] - (point - mirror.centre) / mirror.radius, axis=-1)
    floor = (
        (normal[..., 1] > 0.5) & (cosine > 0.3) & (on.aovs["coverage"] == 1.0) & (box_seen < 0.1)
    )
    # What was reflected is the box itself where it is black without relighting.
    floor &= off.aovs["specular"].min(-1) > 0.05
    column, row = np.moveaxis(view.project(reflected), -1, 0)
    floor &= (column > 1) & (column < 127) & (row > 1) & (row < 95)
    there = np.moveaxis(np.floor(view.project(reflected[floor])).astype(int), -1, 0)
    change = on.color[floor] / off.color[floor]
    assert (change < 0.6).sum() > 30
    # Up to a shift of two pixels, for rays start a little above the sphere.
    around = np.lib.stride_tricks.sliding_window_view(
        np.pad(on.aovs["ratio"], ((2, 2), (2, 2), (0, 0)), "edge"), (5, 5), (0, 1)
    )[there[1], there[0]]
    low, high = around.min((-2, -1)), around.max((-2, -1))
    assert ((change > low - 0.03) & (change < high + 0.03)).mean() > 0.95
    assert (high - low).mean() < 0.35
    # Walls out of view are as light as before.
    beyond = (on.aovs["coverage"] == 1.0) & (cosine > 0.3) & (view.project(reflected)[..., 1] < -2)
    assert beyond.sum() > 30
    np.testing.assert_allclose(on.color[beyond], off.color[beyond], rtol=0.06)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_reflections_are_relit_out_of_view(device: ComputeDevice, estimator: str) -> None:
    """A mirror ball above the view's lower edge shows the shadow below it."""
    mirror = Sphere((0.45, -0.1, -1.9), 0.4)
    objects = [
        ball(mirror.centre, mirror.radius, MIRROR),
        cuboid((-0.15, FLOOR + 0.3, -1.2), (0.25, 0.05, 0.25), BLACK),
    ]
    frame = room_frame(ROOM, 512, 256, ceiling_lamp)
    view = View(128, 96, pitch_deg=12.0)
    on, off = (
        render(device, frame, objects, view, settings(4, relit, estimator), 8)
        for relit in (True, False)
    )
    point, d, cosine = mirror_rays(view, mirror)
    t, normal, _ = ROOM.first_hit(point, d)
    reflected = point + t[..., None] * d
    floor = (normal[..., 1] > 0.5) & (cosine > 0.3) & (on.aovs["coverage"] == 1.0)
    floor &= off.aovs["specular"].min(-1) > 0.05
    down = View(128, 128, pitch_deg=-60.0, fov_y_deg=80.0)
    ratio = render(device, frame, objects, down, settings(4, False, estimator), 8).aovs["ratio"]
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = np.moveaxis(down.project(reflected), -1, 0)
    floor &= (column > 2) & (column < 126) & (row > 2) & (row < 126)
    with np.errstate(divide="ignore", invalid="ignore"):
        assert not (view.project(reflected[floor])[:, 1] < 96).any()
    assert floor.sum() > 60
    change = on.color[floor] / off.color[floor]
    there = ratio[row[floor].astype(int), column[floor].astype(int)]
    assert (there < 0.5).mean() > 0.02
    # Coarser than the view, but not far from it.
    difference = np.abs(change - there).mean()
    assert difference < 0.1
    assert difference < 0.5 * (1.0 - there).mean()
    assert np.corrcoef(change.ravel(), there.ravel())[0, 1] > 0.85
