"""What `CountingDevice` counts, against what is known of the rays."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.counting import CountingDevice, Rays, Work
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from iprt.raster.layers import SAMPLES as COVERAGE_SAMPLES
from iprt.renderer import Renderer
from tests.bvh.tracing import BvhTracer
from tests.device.checked import CheckedDevice, DefectError
from tests.films import films, play
from tests.kernels.tracing import RealTracer, build, panorama_of, random_directions
from tests.oracles.traverse import FlatLayer, _crossings, trace_flat
from tests.oracles.worlds import World
from tests.worlds import bright_walls, room_frame

TRACE = ("other", "trace")
ADD = """
#include "maths/work_counters.h"
__kernel void add(const int count, const uint steps, const Work work)
{
    if (get_global_id(0) >= count)
        return;
    COUNT_ITEM;
    COUNT_RAY(work.counters, WORK_REAL);
    COUNT_STEPS(work.counters, WORK_REAL, steps);
}
"""


def test_steps_in_a_panorama_of_one_level_are_the_texels_on_the_way(device: ComputeDevice) -> None:
    """The brute-force twin has no hierarchy; 8 columns are coarse enough to need none either."""
    counting = CountingDevice(device)
    tracer = RealTracer(counting)
    panorama = panorama_of(device, room_frame(World(), 8, 4, bright_walls))
    assert panorama.shape.levels == 1
    rng = np.random.default_rng(5)
    origins = rng.uniform(-0.7, 0.7, (60, 3)).astype(np.float32)
    directions = random_directions(rng, 60)
    layer = FlatLayer.read(device, panorama, 0.05, 0.05)
    t, _, _ = trace_flat(layer, origins, directions)
    assert np.isfinite(t).all()
    way = _crossings(layer, origins.astype(float), directions.astype(float), t * (1.0 + 1e-9))
    texels = (np.diff(way, axis=1) > 1e-6).sum(axis=1)
    assert texels.max() >= 4

    steps = []
    for origin, direction in zip(origins, directions, strict=True):
        counting.work.clear()
        tracer(panorama, origin[None], direction[None])
        work = counting.work[TRACE]
        assert (work.items, work.groups, work.real.count, work.objects) == (1, 1, 1, Rays())
        assert work.real.steps == work.real.most_steps
        steps.append(work.real.steps)
    # A hit where texels meet at an edge of the room may be in either.
    apart = np.array(steps) - texels
    assert (apart == 0).mean() > 0.9
    assert np.abs(apart).max() <= 1

    counting.work.clear()
    tracer(panorama, origins, directions)
    tracer(panorama, origins, directions)
    assert counting.work[TRACE].real == Rays(120, 2 * sum(steps), max(steps))


def triangles(*centres: float) -> Instance:
    """Four triangles, one packet, around each place along x, 3 m ahead."""
    corners = np.array([[-1, -1, -3], [1, -1, -3], [0, 1, -3]], np.float32)
    shifts = [[x, 0.0, -0.1 * layer] for x in centres for layer in range(4)]
    count = len(shifts)
    mesh = Mesh(
        (corners + np.float32(shifts)[:, None]).reshape(-1, 3),
        np.tile(np.float32([0, 0, 1]), (3 * count, 1)),
        np.zeros((3 * count, 2), np.float32),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        np.zeros(count, np.int32),
        (Material(),),
    )
    return Instance("triangles", mesh, np.eye(4))


@pytest.mark.parametrize(
    ("centres", "ahead", "aside"),
    # A packet; or a node that tells which of two packets to look at, if any. The step to the only
    # instance is none.
    [((0.0,), 1, 1), ((0.0, 9.0), 2, 1)],
)
def test_steps_to_triangles_are_nodes_and_packets(
    device: ComputeDevice, centres: tuple[float, ...], ahead: int, aside: int
) -> None:
    counting = CountingDevice(device)
    tracer = BvhTracer(counting, [triangles(*centres)])
    found = []
    for direction in ((0, 0, -1), (0, 1, 0), (0, 0, 0)):
        counting.work.clear()
        tracer(np.zeros(3), np.float32([direction]))
        found.append(counting.work[TRACE].objects)
    assert found == [Rays(1, ahead, ahead), Rays(1, aside, aside), Rays()]


def test_sums_of_steps_need_more_than_32_bits(device: ComputeDevice) -> None:
    """Three of seventy work items march 3 * 2^30 steps each."""
    counting = CountingDevice(device)
    add = build(counting, ADD, "add")
    add((70,), count=3, steps=3 * 2**30)
    work = counting.work["other", "add"]
    assert work.real == Rays(3, 9 * 2**30, 3 * 2**30)
    group = counting.group_size(1)[0]
    assert (work.items, work.active) == (70, 3)
    assert (work.groups, work.active_groups) == (-(-70 // group), 1)
    add((70,), count=3, steps=5)
    total = counting.work["other", "add"]
    assert total.real == Rays(6, 9 * 2**30 + 15, 3 * 2**30)
    assert Work() + total == total


@pytest.mark.thorough
@pytest.mark.gl
def test_rays_of_a_picture_are_those_asked_for(device: ComputeDevice) -> None:
    film = films(trace={"light_sampling": False}, iprt={"relight_reflections": False})["triangles"]
    counting = CountingDevice(device)
    settings = film.settings
    with Renderer(counting, film.video[0], film.objects, film.view, settings) as renderer:
        counting.work.clear()
        renderer.step()
        work = counting.work
        listed = counting.read(renderer.method.real_pixels.mask.count)[0]
    pixels = film.view.width * film.view.height
    delta, refined = work["trace real", "trace_delta"], work["irradiance", "refine_cells"]
    assert (delta.items, delta.active) == (pixels, listed)
    assert delta.objects.count > 0
    # The first time a cell is seen it gets so many rays, above its surface all of them.
    assert refined.active > 0
    assert refined.real.count == refined.active * 2 * settings.irradiance.rays
    assert refined.objects == Rays()
    assert work["irradiance", "list_cells"].active == listed
    assert work["irradiance", "smooth_cells"].active == refined.active
    seen, shown = (work["draw objects", kernel] for kernel in ("see_objects", "show_objects"))
    assert seen.active == seen.objects.count > 0
    assert shown.objects.count == COVERAGE_SAMPLES**2 * shown.active


@pytest.mark.gl
@pytest.mark.thorough
@pytest.mark.parametrize("name", ["around", "nothing"])
def test_every_kernel_that_counts_leaves_the_picture_as_it_is(
    device: ComputeDevice, name: str
) -> None:
    counting, film = CountingDevice(device), films(gbuffer="cl")[name]
    np.testing.assert_array_equal(play(counting, film).color, play(device, film).color)
    assert bool(counting.work) == (name != "nothing")


@pytest.mark.gl
@pytest.mark.thorough
def test_counting_and_checking_go_together(device: ComputeDevice) -> None:
    """Whichever is put around the other."""
    film = films(gbuffer="cl")["triangles"]
    alone, inside = CountingDevice(device), CountingDevice(device)
    around = CountingDevice(CheckedDevice(device))
    picture = play(alone, film).color
    for counting, used in ((inside, CheckedDevice(inside)), (around, around)):
        assert np.array_equal(play(used, film).color, picture)
        assert counting.work == alone.work
        assert counting.profile.totals()
    with pytest.raises(DefectError, match="kernel 'overrun' of"):
        overrun(CountingDevice(CheckedDevice(device)))


OVERRUN = """
#include "maths/work_counters.h"
__kernel void overrun(__global float *out, const Work work)
{
    COUNT_ITEM;
    if (get_global_id(0) == 0)
        out[64] = 1.0f;
}
"""


def overrun(device: ComputeDevice) -> None:
    """Write beside a buffer."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "overrun.cl"
        file.write_text(OVERRUN)
        device.kernel(str(file), "overrun")((64,), out=device.zeros("out", (64,)))
