"""Every loop of a kernel has a bound, whatever the buffers hold."""

from __future__ import annotations

import re

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.files.resources import CL
from tests.bvh.meshes import instance_of
from tests.bvh.tracing import BvhTracer
from tests.meshes import sphere

SHRINKING = {
    "high - low > 1": "halves what it searches",
}
"""Conditions of loops that count nothing, and why they end."""
FILES = sorted(path.relative_to(CL).as_posix() for path in CL.rglob("*") if path.is_file())


def heads(file: str, word: str) -> list[str]:
    """Return the texts in the parentheses of all loops of one kind."""
    code = re.sub(r"//[^\n]*|/\*.*?\*/", "", (CL / file).read_text(), flags=re.S)
    found = []
    for match in re.finditer(rf"\b{word}\s*\(", code):
        depth, end = 1, match.end()
        while depth:
            depth += {"(": 1, ")": -1}.get(code[end], 0)
            end += 1
        found.append(code[match.end() : end - 1])
    return found


@pytest.mark.parametrize("file", FILES)
def test_every_loop_counts_to_a_bound_or_shrinks(file: str) -> None:
    for head in heads(file, "for"):
        start, condition, step = head.split(";")
        counter = re.fullmatch(r"(?:int )?(\w+) = .+", start.strip())
        assert counter is not None, head
        assert re.search(rf"\b{counter[1]} <=? \S", condition), head
        assert re.fullmatch(rf"{counter[1]}(\+\+| \+= [A-Z]+)", step.strip()), head  # by constants
    assert set(heads(file, "while")) <= set(SHRINKING)


def test_loops_are_found() -> None:
    assert sum(len(heads(file, "for")) for file in FILES) > 50
    assert {head for file in FILES for head in heads(file, "while")} == set(SHRINKING)


def test_a_tree_that_is_none_holds_no_ray_up(device: ComputeDevice) -> None:
    """The root's only child is the root itself."""
    own = ComputeDevice(device.device, limit_s=20.0)
    tracer = BvhTracer(own, [instance_of(sphere(2))])
    root = int(tracer.scene.instances.reshape(-1, 7, 4)[0, 6].view(np.int32)[0])
    buffer = tracer._bvh._buffers["nodes"]
    nodes = own.read(buffer)
    nodes[root, 0::2, 0], nodes[root, 1::2, 0] = -1e6, 1e6
    nodes[root, 0:6:2, 1:], nodes[root, 1:6:2, 1:] = 1e6, -1e6
    nodes[root, 6].view(np.int32)[:] = root
    own.write(buffer, nodes)
    met = tracer(np.zeros((3, 3)), np.eye(3))
    assert not np.isfinite(met.t).any()
