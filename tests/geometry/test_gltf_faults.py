"""Every fault of an animation in a glTF file is one clear line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt.errors import FormatError
from iprt.geometry.animated_mesh import load_animated_mesh
from tests.geometry.gltf_files import STILL, GltfFile, bar


def sampler(file: GltfFile) -> dict[str, Any]:
    entry: dict[str, Any] = file.document["animations"][0]["samplers"][0]
    return entry


def channel(file: GltfFile, **changes: Any) -> None:
    file.document["animations"][0]["channels"][0].update(changes)


def attribute(file: GltfFile, name: str, index: int) -> None:
    file.document["meshes"][0]["primitives"][0]["attributes"][name] = index


def vertices(file: GltfFile) -> int:
    return int(file.document["accessors"][0]["count"])


def weights(file: GltfFile, value: float) -> None:
    values = np.full((vertices(file), 4), 0.25)
    values[7, 2] = value
    attribute(file, "WEIGHTS_0", file.array(values))


FAULTS: dict[str, tuple[Callable[[GltfFile], Any], str]] = {
    "times that stand still": (
        lambda f: sampler(f).update(input=f.array([0.0, 0.0])),
        "samplers[0].input: times that do not ascend",
    ),
    "times before 0": (
        lambda f: sampler(f).update(input=f.array([-1.0, 1.0])),
        "samplers[0].input: times that do not ascend",
    ),
    "times of NaN": (
        lambda f: sampler(f).update(input=f.array([0.0, np.nan])),
        "samplers[0].input: holds NaN",
    ),
    "times of three numbers": (
        lambda f: sampler(f).update(input=f.array([[0.0, 1.0, 2.0]])),
        "samplers[0].input: made of VEC3",
    ),
    "no times": (lambda f: sampler(f).update(input=f.array(np.zeros((0, 1)))), "do not ascend"),
    "more times than values": (
        lambda f: sampler(f).update(input=f.array([0.0, 1.0, 2.0])),
        "samplers[0].output: 2 values for 3 times",
    ),
    "splines without tangents": (
        lambda f: sampler(f).update(interpolation="CUBICSPLINE"),
        "samplers[0].output: 2 values for 2 times",
    ),
    "another interpolation": (
        lambda f: sampler(f).update(interpolation="SMOOTH"),
        "animations[0].samplers[0].interpolation: ",
    ),
    "rotations of three numbers": (
        lambda f: sampler(f).update(output=f.array(np.zeros((2, 3)))),
        "samplers[0].output: made of VEC3",
    ),
    "a rotation of nothing": (
        lambda f: sampler(f).update(output=f.array([STILL, (0, 0, 0, 0)])),
        "samplers[0].output: a quaternion of no length",
    ),
    "values of infinity": (
        lambda f: sampler(f).update(output=f.array([STILL, (0, 0, 0, np.inf)])),
        "samplers[0].output: holds NaN or infinity",
    ),
    "an accessor that is not there": (
        lambda f: sampler(f).update(output=99),
        "samplers[0].output: there is no accessor 99",
    ),
    "a sparse accessor": (
        lambda f: f.document["accessors"][sampler(f)["output"]].update(sparse={}),
        "samplers[0].output: compressed or sparse",
    ),
    "an accessor beyond its view": (
        lambda f: f.document["accessors"][sampler(f)["output"]].update(count=3),
        "ends beyond bufferView",
    ),
    "a sampler that is not there": (
        lambda f: channel(f, sampler=5),
        "channels[0]: there is no sampler 5",
    ),
    "a node that has a matrix": (
        lambda f: f.document["nodes"][2].update(matrix=list(np.eye(4).ravel())),
        "channels[0]: node 2 is placed by a matrix",
    ),
    "two channels for one thing": (
        lambda f: f.document["animations"][0]["channels"].append(
            dict(f.document["animations"][0]["channels"][0])
        ),
        "channels[1]: a second one for the rotation of node 2",
    ),
    "a channel that is text": (
        lambda f: f.document["animations"][0].update(channels="a"),
        "animations[0].channels: ",
    ),
    "an animation that is a number": (
        lambda f: f.document.update(animations=[7]),
        "animations[0]",
    ),
    "joints beyond the skin": (
        lambda f: attribute(f, "JOINTS_0", f.array(np.full((vertices(f), 4), 2), "u1")),
        "nodes[3]: skin 0: joint 2 of 2",
    ),
    "joints that are fractions": (
        lambda f: attribute(f, "JOINTS_0", f.array(np.full((vertices(f), 4), 0.5))),
        "joints that are no whole numbers",
    ),
    "weights of NaN": (lambda f: weights(f, np.nan), "weights that are NaN, infinite or negative"),
    "weights below 0": (lambda f: weights(f, -0.5), "weights that are NaN, infinite or negative"),
    "weights of three numbers": (
        lambda f: attribute(f, "WEIGHTS_0", f.array(np.zeros((vertices(f), 3)))),
        "meshes[0].WEIGHTS_0: ",
    ),
    "fewer weights than vertices": (
        lambda f: attribute(f, "WEIGHTS_0", f.array(np.ones((3, 4)))),
        "meshes[0].WEIGHTS_0: 3 of VEC4; expected",
    ),
    "weights without joints": (
        lambda f: f.document["meshes"][0]["primitives"][0]["attributes"].pop("JOINTS_0"),
        "WEIGHTS_0 without the other",
    ),
    "weights that are not there": (
        lambda f: attribute(f, "WEIGHTS_0", 99),
        "meshes[0].WEIGHTS_0: there is no accessor 99",
    ),
    "a skin that is not there": (
        lambda f: f.document["nodes"][3].update(skin=4),
        "there is no skin 4",
    ),
    "a joint that is not there": (
        lambda f: f.document["skins"][0].update(joints=[1, 17]),
        "skins[0]: joint 17 is no node of the scene",
    ),
    "a joint of another scene": (
        lambda f: f.document["skins"][0].update(joints=[1, f.node()]),
        "skins[0]: joint 4 is no node of the scene",
    ),
    "a skin without joints": (
        lambda f: f.document["skins"][0].update(joints=[]),
        "skins[0].joints: ",
    ),
    "too few matrices": (
        lambda f: f.document["skins"][0].update(
            inverseBindMatrices=f.array(np.eye(4).reshape(1, 16))
        ),
        "skins[0]: 1 inverse bind matrices for 2 joints",
    ),
    "matrices of NaN": (
        lambda f: f.document["skins"][0].update(
            inverseBindMatrices=f.array(np.full((2, 16), np.nan))
        ),
        "skins[0].matrices: holds NaN",
    ),
    "nodes in a circle": (
        lambda f: f.document["nodes"][2].update(children=[1]),
        "node 1 has two parents",
    ),
    "a root that is its own child": (
        lambda f: f.document["nodes"][0].update(children=[0]),
        "root of a tree",
    ),
    "nodes of another scene in a circle": (
        lambda f: (
            f.document["skins"][0].update(joints=[1, f.node(children=[5])]),
            f.node(children=[4]),
        ),
        "skins[0]: joint 4 is no node of the scene",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_one_line(tmp_path: Path, name: str) -> None:
    file = bar()
    change, message = FAULTS[name]
    change(file)
    path = file.write(tmp_path / "b.gltf")
    with pytest.raises(FormatError) as caught:
        load_animated_mesh(path, 0)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_buffers_that_are_cut_off(tmp_path: Path) -> None:
    file = bar()
    path = file.write(tmp_path / "b.glb")
    whole = len(file.data)
    for kept in (0, whole // 2, whole - 8):
        file.data, data = file.data[:kept], file.data
        cut = file.write(path).read_bytes()
        file.data = data
        path.write_bytes(cut.replace(b'"byteLength": %d}]' % kept, b'"byteLength": %d}]' % whole))
        with pytest.raises(FormatError, match=r"b\.glb: "):
            load_animated_mesh(path, 0)
