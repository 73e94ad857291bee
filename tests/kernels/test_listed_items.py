"""Each place of a list is worked on once, by groups that are spread evenly."""

import numpy as np
import pyopencl as cl
import pyopencl.array as cla
import pytest

from iprt.device.program import Program, build

SOURCE = """
#include "maths/listed_items.h"

__kernel void mark(const int count, __global int *visits, __global int *groups)
{
    LIST_ITEM(count);
    atomic_inc(visits + item);
    groups[item] = get_group_id(0);
}
"""
LOCAL = 4


def visited(device, groups, count, offset=0):
    """Return each place's number of visits, and its last group."""
    program = build(device.context, Program.of_text(SOURCE, "mark"))
    size = groups * LOCAL
    visits = cla.zeros(device.queue, offset + size, np.int32)
    by = cla.zeros(device.queue, offset + size, np.int32) - 1
    kernel = cl.Kernel(program, "mark")
    kernel.set_args(np.int32(count), visits.data, by.data)
    cl.enqueue_nd_range_kernel(
        device.queue, kernel, (size,), (LOCAL,), (offset,) if offset else None
    )
    return visits.get(), by.get()


@pytest.mark.parametrize("groups", [1, 2, 3, 5, 8, 63, 64, 100, 1000])
def test_each_place_is_worked_on_once(device, groups):
    size = groups * LOCAL
    assert np.all(visited(device, groups, size)[0] == 1)
    visits = visited(device, groups, size // 3)[0]
    assert np.all(visits[: size // 3] == 1)
    assert np.all(visits[size // 3 :] == 0)


def test_a_part_of_a_launch_works_on_its_part_of_the_list(device):
    visits = visited(device, 8, 1000, offset=12 * LOCAL)[0]
    assert np.all(visits[: 12 * LOCAL] == 0)
    assert np.all(visits[12 * LOCAL :] == 1)


@pytest.mark.parametrize("share", [16, 5, 2])
@pytest.mark.parametrize("groups", [512, 700])
def test_any_run_of_groups_holds_as_much_of_the_list(device, groups, share):
    used = 512 // share
    by = visited(device, groups, used * LOCAL)[1][: used * LOCAL : LOCAL]
    busy = np.zeros(512, int)
    busy[by] = 1
    # The van der Corput sequence puts k or k + 1 of its points into intervals of one length.
    for run in (32, 64, 256):
        counts = busy.reshape(-1, run).sum(axis=1)
        assert np.ptp(counts) <= 1
        assert counts.sum() == used
