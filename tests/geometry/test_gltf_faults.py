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
    "times of NaN": (
        lambda f: sampler(f).update(input=f.array([0.0, np.nan])),
        "samplers[0].input: holds NaN",
    ),
    "more times than values": (
        lambda f: sampler(f).update(input=f.array([0.0, 1.0, 2.0])),
        "samplers[0].output: 2 values for 3 times",
    ),
    "rotations of three numbers": (
        lambda f: sampler(f).update(output=f.array(np.zeros((2, 3)))),
        "samplers[0].output: made of VEC3",
    ),
    "a rotation of nothing": (
        lambda f: sampler(f).update(output=f.array([STILL, (0, 0, 0, 0)])),
        "samplers[0].output: a quaternion of no length",
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
    "fewer normals than vertices": (
        lambda f: attribute(f, "NORMAL", f.array(np.ones((3, 3)))),
        "meshes[0].NORMAL: 3 for 72 vertices",
    ),
    "fewer weights than vertices": (
        lambda f: attribute(f, "WEIGHTS_0", f.array(np.ones((3, 4)))),
        "meshes[0].WEIGHTS_0: 3 of VEC4; expected",
    ),
    "weights without joints": (
        lambda f: f.document["meshes"][0]["primitives"][0]["attributes"].pop("JOINTS_0"),
        "WEIGHTS_0 without the other",
    ),
    "a skin that is not there": (
        lambda f: f.document["nodes"][3].update(skin=4),
        "there is no skin 4",
    ),
    "a joint that is not there": (
        lambda f: f.document["skins"][0].update(joints=[1, 17]),
        "skins[0]: joint 17 is no node of the scene",
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
