"""Online illumination learning as a method: pictures, the view of what was learned, the region."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.aovs import read_aov
from iprt.device.compute import ComputeDevice
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from iprt.world.real.panorama import Panorama
from iprt.world.real.radiance_models import Learner, Learning
from tests.oracles.learned import predicted
from tests.oracles.worlds import World
from tests.rendering import render
from tests.trace.closed_forms import BALL, LAMP, box_of
from tests.trace.environments import windowed
from tests.trace.estimators import kernels
from tests.worlds import ball, bright_walls, ceiling_lamp, filmed, pose_at, room_frame

pytestmark = pytest.mark.gl

VIEW = View(48, 36, pitch_deg=-35.0)
MIRROR = Material("conductor", (0.9, 0.8, 0.7), alpha=0.0)
FEW = {"samples": 4096, "models": 8192}


def chosen(**learning: Any) -> Settings:
    return Settings.model_validate({"method": "oil", "learning": {**FEW, **learning}})


def plain(method: str) -> Settings:
    """As traced: what remains is noise, which averages out."""
    return Settings.model_validate({
        "method": method, method: {"surfaces": "all"}, "learning": FEW,
        "fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False},
        "trace": {"rays": 8, "object_rays": 8},
    })  # fmt: skip


@pytest.mark.thorough
def test_the_picture_is_that_of_path_tracing(device: ComputeDevice) -> None:
    """In a room that does not change, of radiance that models can show."""
    frame = room_frame(World(), 256, 128, bright_walls)
    objects = [
        ball((0.2, -1.0, -1.4), 0.3, Material(albedo=(0.6, 0.5, 0.4))),
        ball((-0.5, -1.1, -1.5), 0.25, MIRROR),
    ]
    ours, theirs = (
        render(device, frame, objects, VIEW, settings, 24).color
        for settings in (plain("oil"), plain("dpt"))
    )
    assert np.abs(ours - theirs).mean() < 0.015 * theirs.mean()
    assert abs(ours.mean() - theirs.mean()) < 3e-3 * theirs.mean()


def test_radiance_is_that_which_was_learned(device: ComputeDevice) -> None:
    """Models that learned another light: objects show it, while real surfaces stay."""
    frame = room_frame(World(), 256, 128, bright_walls)
    objects = [ball((0.2, -1.0, -1.4), 0.3, MIRROR, subdivisions=5)]
    shown = []
    for factor in (1.0, 3.0):
        last = plain("oil").model_copy(update={"fading": 1.0})
        with Renderer(device, frame, objects, VIEW, last) as renderer:
            learner = renderer.method.learned.learner

            def brighter(*texels: Any, draw: Any = learner.draw, factor: float = factor) -> Any:
                drawn = draw(*texels)

                def scaled() -> Any:
                    samples, covered = drawn()
                    samples[:, 2, :3] *= factor
                    return samples, covered

                return scaled

            learner.draw = brighter
            picture = renderer.render(6, ["specular", "coverage", "learned"])
        shown.append(picture.aovs)
    inside = shown[0]["coverage"] == 1.0
    ratio = shown[1]["specular"][inside] / shown[0]["specular"][inside]
    assert np.median(ratio) == pytest.approx(3.0, rel=0.02)
    known = shown[0]["learned"].min(axis=-1) > 0.0
    assert known[~inside].mean() > 0.95
    assert np.median(shown[1]["learned"][known] / shown[0]["learned"][known]) == pytest.approx(3.0)


@pytest.mark.thorough
def test_windows_show_what_the_panorama_does(device: ComputeDevice) -> None:
    """Even where models know a wall in their place."""
    frame = room_frame(World(), 128, 64, bright_walls)
    everywhere = replace(frame, opening=np.ones_like(frame.opening))
    objects = [ball((0.2, -1.0, -1.4), 0.3, MIRROR)]
    walls = Panorama(device, 128, 64)
    walls.load(frame)
    pictures = []
    for settings in (plain("oil"), plain("dpt")):
        with Renderer(device, everywhere, objects, VIEW, settings) as renderer:
            if settings.method == "oil":
                learner = renderer.method.learned.learner
                learner.draw = lambda *_, draw=learner.draw: draw(walls.surfaces, walls.radiated)
            pictures.append(renderer.render(4).color)
    assert learner.count > 100
    np.testing.assert_array_equal(*pictures)


def test_the_view_of_what_was_learned(device: ComputeDevice) -> None:
    """By all models, without a grid, at the pixels' positions; near the panorama's own."""
    frame = room_frame(World(), 256, 128, bright_walls)
    with Renderer(device, frame, [ball(*BALL, LAMP)], VIEW, chosen()) as renderer:
        renderer.render(8)
        shown = read_aov(renderer, "learned")
        guide = renderer.layout.interior(
            device.read(renderer.method.real_pixels.guide.current)
        ).astype(np.float64)
        models = renderer.method.learned.learner.models()
        radius = 0.2 * renderer.real_world.panorama.scale
        background = read_aov(renderer, "background")
    normals, points = (np.moveaxis(guide[i : i + 3], 0, -1).reshape(-1, 3) for i in (0, 3))
    wanted, weight = predicted(models, points, normals, radius)
    wanted, known = wanted.reshape(shown.shape), (weight > 0.2).reshape(shown.shape[:2])
    assert known.mean() > 0.9
    assert np.isclose(shown, wanted, rtol=2e-3)[known].mean() > 0.98
    assert np.median(np.abs(shown / background - 1.0)[known]) < 0.03


@pytest.mark.thorough
def test_real_surfaces_change_within_the_region_alone(device: ComputeDevice) -> None:
    """Within the boxes enlarged about their middle, and there as everywhere."""
    frame, thing = windowed(), box_of(Material(albedo=(0.4, 0.3, 0.2)))
    view = View(48, 36, pitch_deg=-45.0, fov_y_deg=70.0)
    parts = {}
    for name, own in (("all", {"surfaces": "all"}), ("region", {"region": 1.5})):
        with kernels(device, frame, [thing], "oil, aimed", view=view, own=own) as run:
            parts[name] = run.parts(3, 8)
            points, _ = run.receivers()
            low, high = bounds_of(run.renderer)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    reach = np.abs(points - middle) / half
    inside, outside = (reach < 2.48).all(-1), (reach > 2.52).any(-1)
    assert inside.sum() > 20
    assert outside.sum() > 20
    np.testing.assert_array_equal(parts["region"][outside], 0.0)
    np.testing.assert_array_equal(parts["region"][inside], parts["all"][inside])
    assert parts["all"][outside].max() > 0.0
    assert parts["region"][inside].max() > 0.0


def bounds_of(renderer: Renderer) -> Any:
    """Lower and upper corner (3,) of the one object."""
    return renderer.world.objects.bounds[0, :, :3].astype(np.float64)


@pytest.mark.thorough
def test_what_was_learned_stays_where_it_is_while_the_camera_moves(device: ComputeDevice) -> None:
    world, objects = World(), [ball((0.2, -1.0, -1.4), 0.3, LAMP)]
    poses = [pose_at(), pose_at((0.5, 0.1, -0.4), 40.0)]
    first, second = (filmed(world, 128, 64, bright_walls, pose) for pose in poses)
    settings = chosen()
    with Renderer(device, first, objects, VIEW, settings, footage=Footage.of(first)) as renderer:
        renderer.render(6)
        # Nothing is learned from the second frame.
        renderer.method.learned.learner.learn = lambda *_: None
        renderer.load(second)
        renderer.step()
        shown, background = (read_aov(renderer, name) for name in ("learned", "background"))
    known = shown.min(axis=-1) > 0.0
    assert known.mean() > 0.5
    assert np.median(np.abs(shown / background - 1.0)[known]) < 0.05


def test_a_cut_forgets(device: ComputeDevice) -> None:
    """Light that is switched is another; a light that dims is followed."""
    bright, dim = (room_frame(World(), 64, 32, light) for light in (bright_walls, ceiling_lamp))
    settings = chosen(samples=1024)
    with Renderer(
        device, bright, [ball(*BALL, LAMP)], VIEW, settings,
        footage=Footage(video=True, static_camera=True),
    ) as renderer:  # fmt: skip
        renderer.render(3)
        learner = renderer.method.learned.learner
        known = learner.models()[:, 1, 3].max()
        renderer.load(replace(bright, color=0.98 * bright.color))
        renderer.render(2)  # the second learns what the first drew
        assert learner.models()[:, 1, 3].max() > known
        renderer.load(dim)
        renderer.step()
        assert learner.models()[:, 1, 3].max() < known


def test_a_still_is_learned_until_as_many_samples_as_texels_were_drawn(
    device: ComputeDevice,
) -> None:
    frame = room_frame(World(), 64, 32, bright_walls)
    settings = chosen(samples=512)
    with Renderer(device, frame, [ball(*BALL, LAMP)], VIEW, settings) as renderer:
        renderer.render(7)
        assert renderer.method.learned.learner.learned == 64 * 32


def test_learning_waits_in_the_first_frame_alone(device: ComputeDevice) -> None:
    """Models are those of a learner that waits for each batch; none was drawn before a cut."""
    bright, dim = (room_frame(World(), 64, 32, light) for light in (bright_walls, ceiling_lamp))
    settings = chosen(samples=512)
    with Renderer(
        device, bright, [ball(*BALL, LAMP)], VIEW, settings,
        footage=Footage(video=True, static_camera=True),
    ) as renderer:  # fmt: skip
        learned, panorama, waits = renderer.method.learned, renderer.real_world.panorama, []

        def counted(texels: Panorama, learn: Any = learned.learn) -> None:
            before = device.profile.waits
            learn(texels)
            waits.append(device.profile.waits - before)

        def waited(first: int, batches: int) -> Any:
            learner = Learner(device, 512, FEW["models"])
            learner.learned = first
            how = Learning(0.2 * panorama.scale, panorama.scale, panorama.mean_radiance)
            for _ in range(batches):
                samples, _ = learner.draw(panorama.surfaces, panorama.radiated)()
                learner.learn(samples, how)
            return learner.models()

        learned.learn = counted
        renderer.render(5)
        np.testing.assert_array_equal(learned.learner.models(), waited(0, 4))
        renderer.load(replace(bright, color=0.98 * bright.color))
        renderer.render(2)
        assert waits[1:] == 6 * [0]
        first = learned.learner.learned
        renderer.load(dim)
        renderer.render(3)
        np.testing.assert_array_equal(learned.learner.models(), waited(first, 3))
    assert waits[8:] == 2 * [0]
