"""Tiny films that together launch every kernel: frames at odd sizes, in each way to render them.

For checks that watch all memory that kernels touch, some of them a thousand times slower than the
frames themselves.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import numpy as np

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.plan import PlanDevice
from iprt.device.program import PlannedKernel
from iprt.files.resources import CL
from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_direction
from iprt.geometry.light import PROFILE_SHAPE, Light
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, light_mesh
from iprt.geometry.variants import Variants
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.meshes import transform
from tests.oracles.worlds import Box, World
from tests.worlds import (
    ball,
    bright_walls,
    ceiling_lamp,
    cuboid,
    landscape_frame,
    pose_at,
    room_frame,
)

ROOM = World(solids=(Box((-0.8, -0.9, -1.7), (0.25, 0.5, 0.2)),))
CHECKS = np.random.default_rng(0).random((3, 5, 3)).astype(np.float32)
FLOOR = Material("plastic", alpha=0.2)
WALL = Material("conductor", (0.9, 0.7, 0.5), alpha=0.1)
LAMP = Material(emission=(5.0, 4.0, 3.0), emission_texture=CHECKS)
GLASS = Material("dielectric", (1.0, 0.9, 0.9), alpha=0.05, absorption=(1.0, 2.0, 3.0))
HALF_GLASS = Material("principled", alpha=0.0, transmission=0.5, thin=True)
VARNISH = Material("principled", alpha=0.3, clearcoat=0.8, sheen=(0.5, 0.2, 0.1))
LOOK, LARGE_LOOK, TWICE = (View(*size, pitch_deg=-35.0) for size in ((7, 5), (13, 7), (26, 14)))
"""Most branches of the kernels are reached by few pixels; some films need more to meet all."""
AROUND, WIDE_AROUND = (View(*size, projection="equirect") for size in ((33, 3), (65, 6)))
FEW: dict[str, Any] = {
    "trace": {"object_rays": 1},
    "irradiance": {"rows": 16, "rays": 1},
    "atrous": {"levels": 1},
    "gloss": {"rays": 2},
    # The map of shadows off screen takes longer than these pictures.
    "iprt": {"ratio_rows": 16, "relight_reflections": False},
}
VOXELS: dict[str, Any] = {"voxels": 16, "object_voxels": 16}
DELTA_VOXELS: dict[str, Any] = {"voxels": 16, "room_voxels": 16, "lights": 2, "map_side": 8}
LITTLE: dict[str, Any] = {"learning": {"samples": 256, "models": 64}}
TWO_LEVELS: dict[str, Any] = {"atrous": {"levels": 2}}
TRIANGLES: dict[str, Any] = {
    "gbuffer": "cl",
    "iprt": {"relight_reflections": True},
    **TWO_LEVELS,
}
LAYERS: dict[str, Any] = {
    "method": "iprt2023",
    "iprt2023": {"filter": "fast-slow"},
    "trace": {"bounces": 4, "light_sampling": True},
}
ALL_LEVELS: dict[str, Any] = {"atrous": {"levels": 5}}
"""Taps of the last level reach the edge of the border around the planes."""


@dataclass(frozen=True)
class Film:
    """Two frames of video, the objects in them, and how they are looked at and rendered."""

    video: tuple[Frame, Frame]
    objects: tuple[Instance, ...]
    view: View
    settings: Settings
    static_camera: bool = False


def by(method: str, **own: Any) -> dict[str, Any]:
    """Return settings that choose a method and set its own settings."""
    return {"method": method, **({method: own} if own else {})}


def films(**settings: Any) -> dict[str, Film]:
    """All of them, by name; with `settings` besides their own."""
    room, glossy = _room(20, 10), _glossy(_room(19, 9))
    clay, plastic, mirror, brass = _objects()
    # A grid that reaches there too has few voxels on each object, of which every one takes long.
    far = ball((1.2, -1.0, 1.2), 0.03, Material(), subdivisions=0)
    textured = replace(clay, mesh=replace(clay.mesh, materials=(Material(texture=CHECKS),)))
    every, glazed = _objects(), (textured, plastic, mirror)
    glowing = replace(clay, mesh=replace(clay.mesh, materials=(LAMP,)))
    bulb = ball((0.0, -1.1, -1.7), 0.3, LAMP, subdivisions=3)  # enough triangles for a tree
    clear = replace(clay, mesh=replace(clay.mesh, materials=(GLASS,)))
    sheet = replace(plastic, mesh=replace(plastic.mesh, materials=(HALF_GLASS,)))
    varnished = replace(clay, mesh=replace(clay.mesh, materials=(VARNISH,)))
    own: dict[str, tuple[tuple[Frame, Frame], tuple[Instance, ...], View, dict[str, Any]]] = {
        "triangles": (_sunny(_carried(room)), _bending((*glazed, brass)), LOOK, TRIANGLES),
        "maps": (room, (_mapped(clay), plastic), LOOK, TRIANGLES),
        "lamps": (_sunny(_glossy(_room(19, 9))), (bulb, plastic), LOOK, TRIANGLES),
        "glass": (_sunny(_glossy(_room(19, 9))), (clear, sheet), LOOK, TRIANGLES),
        "virtual lights": (
            _sunny(_glossy(_room(19, 9))),
            (clay, plastic, brass, *_lights()),
            LOOK,
            TRIANGLES,
        ),
        "covers": (_sunny(_glossy(_room(19, 9))), (varnished, plastic), LOOK, TRIANGLES),
        "layers": (_room(32, 16), (plastic, brass), LOOK, {**LAYERS, **ALL_LEVELS}),
        "published": (
            room,
            (clay, mirror),
            LOOK,
            {**by("iprt2023", objects="triangles"), **TWO_LEVELS},
        ),
        "around": (_drifting(glossy), every, WIDE_AROUND, {"light_scale": 2}),
        "remembered": (_glossy(_passing(30, 15)), (clay, brass), TWICE, {"light_scale": 2}),
        "layers around": (_landscape(), (glowing, clear), AROUND, LAYERS),
        "environment": (room, every, LOOK, by("ibl")),
        "shadowing environment": (glossy, glazed, LOOK, by("em")),
        "delta paths": (room, glazed, LOOK, {**by("dpt"), **TWO_LEVELS}),
        "delta paths around": (room, (clay,), AROUND, by("dpt", surfaces="all")),
        "impostor": (room, glazed, LOOK, by("dit", resolution=9)),
        "impostor around": (
            _drifting(_landscape()),
            (clay,),
            AROUND,
            by("dit", resolution=8, directions="boxes"),
        ),
        "differential paths": (
            _room(32, 16),
            (glowing, clear),
            LARGE_LOOK,
            by("pt-diff", surfaces="all"),
        ),
        "learned": (room, (clay, brass), LARGE_LOOK, {**by("oil", region=1.0), **LITTLE}),
        "learned on a walk": (
            _carried(room),
            (plastic, mirror),
            LOOK,
            {**by("oil", surfaces="all"), **LITTLE},
        ),
        "cones": (room, (*glazed, far), LARGE_LOOK, by("vct", **VOXELS)),
        "cones around": (
            _landscape(),
            (clay, far),
            AROUND,
            by("vct", **VOXELS, anisotropic=False),
        ),
        "delta cones": (_glossy(_room(29, 15)), (*glazed, far), LOOK, by("dvct", **DELTA_VOXELS)),
        "nothing": (_clipped(_room(19, 9)), (), LOOK, {}),
    }
    return {
        name: Film(
            video,
            objects,
            view,
            Settings.model_validate(_merged(FEW, chosen, settings)),
            static_camera=name == "remembered",
        )
        for name, (video, objects, view, chosen) in own.items()
    }


def play(device: ComputeDevice, film: Film) -> RenderedFrame:
    """The second of two frames; in between the head turned, objects moved, the video went on."""
    with Renderer(
        device,
        film.video[0],
        film.objects,
        film.view,
        film.settings,
        footage=Footage.of(film.video[0], static_camera=film.static_camera),
    ) as renderer:
        renderer.step()
        if film.view.projection == "perspective":
            renderer.look(replace(film.view, yaw_deg=film.view.yaw_deg + 4.0))
        renderer.load(film.video[1])
        renderer.move([_moved(instance) for instance in film.objects])
        return renderer.render(1, AOVS)


@contextmanager
def launches() -> Iterator[set[str]]:
    """The names of the kernels that are launched meanwhile, on any device."""
    names: set[str] = set()
    launch = Kernel.__call__

    def record(self: Kernel, *groups: Any, **own: Any) -> None:
        names.add(self.name)
        launch(self, *groups, **own)

    with mock.patch.object(Kernel, "__call__", record):
        yield names


def planned_kernels(*, is_cpu: bool = False) -> list[PlannedKernel]:
    """File, kernel and defines of all that the films build on a GPU or a CPU, each once."""
    plan = PlanDevice(is_cpu=is_cpu)
    for film in films().values():
        frame = film.video[0]
        footage = Footage.of(frame, static_camera=film.static_camera)
        Renderer(plan, frame, film.objects, film.view, film.settings, footage=footage)
    found = {(one.file, one.name, tuple(sorted(one.defines.items()))) for one in plan.kernels}
    return [PlannedKernel(file, name, dict(defines)) for file, name, defines in sorted(found)]


def entry_points() -> set[str]:
    """The names of all kernels in `cl/`."""
    declared = re.compile(r"^(?:__kernel|TRACING_KERNEL) void (\w+)\(", re.MULTILINE)
    return {name for file in CL.rglob("*.cl") for name in declared.findall(file.read_text())}


def _room(width: int, height: int) -> tuple[Frame, Frame]:
    """A room with a window ahead, among bright walls and then below a lamp."""
    before, after = (
        room_frame(ROOM, width, height, light) for light in (bright_walls, ceiling_lamp)
    )
    rows, columns = np.indices((height, width))
    window = (np.abs(rows / height - 0.45) < 0.1) & (np.abs(columns / width - 0.6) < 0.1)
    return replace(before, opening=window), replace(after, opening=window)


def _passing(width: int, height: int) -> tuple[Frame, Frame]:
    """A room in which something comes between the camera, a window and the floor."""
    before, after = (
        room_frame(World(solids=(*ROOM.solids, *solids)), width, height, bright_walls)
        for solids in ((), (Box((0.35, -0.5, -0.9), (0.25, 0.8, 0.1)),))
    )
    rows, columns = np.indices((height, width))
    window = (np.abs(rows / height - 0.45) < 0.1) & (np.abs(columns / width - 0.6) < 0.1)
    hidden = after.depth < before.depth
    return replace(before, opening=window), replace(after, opening=window & ~hidden)


def _glossy(video: tuple[Frame, Frame]) -> tuple[Frame, Frame]:
    gloss = np.where(video[0].normal[..., 1] > 0.5, 1, 0).astype(np.uint8)
    gloss[video[0].normal[..., 0] > 0.5] = 2
    first, second = (replace(f, gloss=gloss, real_materials=(FLOOR, WALL)) for f in video)
    return first, second


def _clipped(video: tuple[Frame, Frame]) -> tuple[Frame, Frame]:
    """Every other texel was clipped."""
    texel = np.arange(0, video[0].depth.size, 2, dtype=np.int32)
    seen = np.ones((texel.size, 3), np.float32)
    first, second = (replace(frame, clipped=ClippedTexels(texel, seen)) for frame in video)
    return first, second


def _carried(video: tuple[Frame, Frame]) -> tuple[Frame, Frame]:
    """Give the frames poses of a moving camera."""
    first, second = video
    return replace(first, pose=pose_at()), replace(second, pose=pose_at((0.1, 0.0, -0.1), 3.0))


def _sunny(video: tuple[Frame, Frame]) -> tuple[Frame, Frame]:
    """Let a wide sun shine through the window of `_room`."""
    towards = equirect_direction(np.array([0.6, 0.45]), 1, 1)
    first, second = (replace(f, sun=Sun(towards, (9.0, 8.0, 7.0), angle_deg=10.0)) for f in video)
    return first, second


def _drifting(video: tuple[Frame, Frame]) -> tuple[Frame, Frame]:
    """Mark the frames as exposed twice as long as the video's first one."""
    first, second = (replace(frame, color_map=0.5 * np.eye(3)) for frame in video)
    return first, second


def _landscape() -> tuple[Frame, Frame]:
    frame = landscape_frame(19, 11)
    return frame, replace(frame, color=frame.color * np.float32(0.5))


def _mapped(instance: Instance) -> Instance:
    """Return an object with maps of everything, and holes."""
    mesh = instance.mesh
    material = Material(
        "principled",
        alpha=0.3,
        metallic=0.7,
        cutoff=0.3,
        texture=CHECKS,
        surface_texture=CHECKS[..., :2],
        normal_texture=2.0 * CHECKS - 1.0,
        clearcoat_normal_texture=2.0 * CHECKS[::-1] - 1.0,
        opacity_texture=CHECKS[..., 0],
        variants=Variants(
            ("clearcoat",), ((0.0,), (0.8,)), (CHECKS[..., 0] > 0.5).astype(np.uint8)
        ),
    )
    tangents = np.ones((len(mesh.positions), 4), np.float32)
    return replace(instance, mesh=replace(mesh, materials=(material,), tangents=tangents))


def _objects() -> tuple[Instance, ...]:
    """Return an object of every kind of material."""
    return (
        ball((0.0, -1.1, -1.7), 0.3, Material(), subdivisions=1),
        cuboid((0.5, -1.2, -1.3), (0.22, 0.2, 0.15), Material("plastic", alpha=0.2)),
        ball((-0.15, -1.28, -1.15), 0.12, Material("conductor", alpha=0.0), subdivisions=1),
        ball((-0.45, -1.25, -1.3), 0.15, Material("conductor", alpha=0.2), subdivisions=1),
    )


def _lights() -> tuple[Instance, ...]:
    """Return a light without geometry of every kind, which shine down."""
    profile = np.ones(PROFILE_SHAPE, np.float32)
    down = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    kinds = (
        Light(radius=0.1, profile=profile),
        Light(cone_deg=(20.0, 40.0)),
        Light("rectangle"),
        Light("sun", diameter_deg=5.0),
    )
    places = [(x, -0.2, -1.4) for x in (-0.3, 0.0, 0.3, 0.6)]
    return tuple(
        Instance(f"light {number}", light_mesh(light), transform(down, place))
        for number, (light, place) in enumerate(zip(kinds, places, strict=True))
    )


def _bending(objects: tuple[Instance, ...]) -> tuple[Instance, ...]:
    """The first of them may change its shape."""
    first, *others = objects
    return replace(first, mesh=replace(first.mesh, deforms=True)), *others


def _moved(instance: Instance) -> Instance:
    """A little to the right; and larger, where the mesh deforms."""
    to_world = instance.to_world.copy()
    to_world[0, 3] += 0.02
    mesh = instance.mesh
    if mesh.deforms:
        mesh = replace(mesh, positions=np.float32(1.1) * mesh.positions)
    return replace(instance, mesh=mesh, to_world=to_world)


def _merged(*tables: Mapping[str, Any]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for table in tables:
        for key, value in table.items():
            inner = isinstance(value, dict)
            result[key] = _merged(result.get(key, {}), value) if inner else value
    return result
