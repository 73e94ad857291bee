"""An animation of a glTF file, checked and read: how its nodes move, and what its skins follow.

Specification: Khronos glTF 2.0, sections 3.6.2 (accessors), 3.7.3 (skins), 3.11 (animations).
pydantic checks the document's shape; only the animation asked for, and the skins that it bends, are
looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from iprt.errors import FormatError
from iprt.files.toml_text import printable
from iprt.geometry.animation import Float, Node, Skeleton, Track
from iprt.geometry.gltf_check import (
    MAX_NODES,
    MAX_PARTS,
    Gltf,
    Index,
    Part,
    accessor_of,
    first_fault,
)
from iprt.geometry.gltf_numbers import INFLUENCES
from iprt.geometry.mesh_files import MeshFile

Model = TypeVar("Model", bound=Part)

MAX_NAMES = 20
"""An error lists no more animations."""
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_TYPES = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
_COLUMNS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class _Target(Part):
    node: Index | None = None
    path: str


class _Channel(Part):
    sampler: Index
    target: _Target


class _Sampler(Part):
    input: Index
    output: Index
    interpolation: Literal["LINEAR", "STEP", "CUBICSPLINE"] = "LINEAR"


class _Animation(Part):
    name: str | None = None
    channels: Annotated[list[_Channel], Field(max_length=MAX_PARTS)]
    samplers: Annotated[list[_Sampler], Field(max_length=MAX_PARTS)]


class _Skin(Part):
    joints: Annotated[list[Index], Field(min_length=1, max_length=MAX_NODES)]
    inverse_bind_matrices: Index | None = None


@dataclass(frozen=True)
class Bones:
    """The joints of a skin.

    Attributes
    ----------
    nodes : (J,) int64
    inverse_bind : (J, 4, 4) float64
    """

    nodes: NDArray[np.int64]
    inverse_bind: Float


@dataclass(frozen=True)
class Clip:
    """An animation.

    Attributes
    ----------
    duration : float
        Seconds from 0 to the last key; then it starts anew.
    skeleton : Skeleton
        All nodes of the file's scene.
    bones : dict of int to Bones
        By number of the skin.
    """

    name: str
    duration: float
    skeleton: Skeleton
    bones: dict[int, Bones]

    def pose(self, time_s: float) -> dict[int, Float]:
        """(4, 4) by node, to the file's world."""
        return self.skeleton.pose(time_s % self.duration if self.duration > 0.0 else 0.0)


def read_clip(file: MeshFile, choice: str | int, dropped: list[str]) -> Clip:
    """Read an animation by its name or number; what of it is not read is appended to `dropped`.

    Raises
    ------
    FormatError
        The file has no such animation.
    ValueError
        What it has is not one; in one line.
    """
    gltf = file.gltf
    if gltf is None or not gltf.animations:
        raise FormatError(f"{file.path}: has no animations; leave `animation` out")
    number = _chosen(file, gltf, choice)
    where = f"animations[{number}]"
    animation = _parsed(_Animation, gltf.animations[number], where)
    nodes = _nodes(gltf)
    tracks: dict[int, dict[str, Track]] = {}
    samplers: dict[tuple[int, str], Track] = {}
    for index, channel in enumerate(animation.channels):
        node, path = channel.target.node, channel.target.path
        if path not in _TYPES:
            dropped.append("animated morph targets" if path == "weights" else "animated extensions")
            continue
        if node is None or node not in nodes:
            continue  # of an extension, or of another scene
        here = f"{where}.channels[{index}]"
        if nodes[node].matrix is not None:
            raise ValueError(f"{here}: node {node} is placed by a matrix and cannot move")
        if path in tracks.setdefault(node, {}):
            raise ValueError(f"{here}: a second one for the {path} of node {node}")
        if channel.sampler >= len(animation.samplers):
            raise ValueError(f"{here}: there is no sampler {channel.sampler}")
        key = (channel.sampler, path)
        if key not in samplers:
            sampler = animation.samplers[channel.sampler]
            samplers[key] = _track(file, sampler, path, f"{where}.samplers[{channel.sampler}]")
        tracks[node][path] = samplers[key]
    duration = max((float(track.times[-1]) for track in samplers.values()), default=0.0)
    used = dict.fromkeys(gltf.nodes[index].skin for index in nodes)
    bones = {skin: _bones(file, skin, nodes) for skin in used if skin is not None}
    _check_joints(gltf)
    name = animation.name or str(number)
    return Clip(printable(name), duration, Skeleton(nodes, tracks), bones)


def _chosen(file: MeshFile, gltf: Gltf, choice: str | int) -> int:
    names = _names(gltf)
    if isinstance(choice, int) and choice < len(names):
        return choice
    found = [number for number, name in enumerate(names) if name == choice]
    if len(found) == 1:
        return found[0]
    if found:
        numbers = ", ".join(map(str, found))
        raise FormatError(
            f"{file.path}: animations {numbers} are all named '{choice}'; give one's number"
        )
    known = ", ".join(animation_names(gltf))
    raise FormatError(f"{file.path}: has no animation {choice!r}; it has {known}")


def animation_names(gltf: Gltf) -> list[str]:
    """Number and name of each of the first animations: `0 ('walk')`."""
    return [
        f"{number} ('{printable(name)}')" if isinstance(name, str) else f"{number}"
        for number, name in enumerate(_names(gltf)[:MAX_NAMES])
    ]


def _names(gltf: Gltf) -> list[object]:
    return [entry.get("name") if isinstance(entry, dict) else None for entry in gltf.animations]


def _nodes(gltf: Gltf) -> dict[int, Node]:
    """The nodes of the file's scene, which are trees, parents first."""
    nodes: dict[int, Node] = {}
    roots = dict.fromkeys(gltf.scenes[gltf.scene].nodes) if gltf.scenes else {}
    level = [(-1, index) for index in roots]
    while level:
        for parent, index in level:
            entry = gltf.nodes[index]
            given = {
                key: np.array(value, np.float64)
                for key in ("translation", "rotation", "scale")
                if (value := getattr(entry, key)) is not None
            }
            if "rotation" in given:
                given["rotation"] = _unit(given["rotation"], f"nodes[{index}].rotation")
            matrix = None
            if entry.matrix is not None:
                matrix = np.array(entry.matrix, np.float64).reshape(4, 4).T  # column by column
            nodes[index] = Node(parent, **given, matrix=matrix)
        level = [(index, child) for _, index in level for child in gltf.nodes[index].children]
    return nodes


def _track(file: MeshFile, sampler: _Sampler, path: str, where: str) -> Track:
    times = values_of(file, sampler.input, ("SCALAR",), f"{where}.input")[:, 0]
    values = values_of(file, sampler.output, (_TYPES[path],), f"{where}.output")
    if len(times) == 0 or not (times[0] >= 0.0 and (np.diff(times) > 0.0).all()):
        raise ValueError(f"{where}.input: times that do not ascend from 0 on")
    cubic = sampler.interpolation == "CUBICSPLINE"
    wanted = len(times) * (3 if cubic else 1)
    if len(values) != wanted:
        raise ValueError(f"{where}.output: {len(values)} values for {len(times)} times")
    if cubic:
        values = values.reshape(len(times), 3, -1)
    if path == "rotation":
        keys = values[:, 1] if cubic else values
        keys[:] = _unit(keys, f"{where}.output")
    held = np.full(len(times), sampler.interpolation == "STEP")
    return Track(times, values, held, rotation=path == "rotation")


def _bones(file: MeshFile, number: int, nodes: dict[int, Node]) -> Bones:
    assert file.gltf is not None
    where = f"skins[{number}]"
    if number >= len(file.gltf.skins):
        raise ValueError(f"there is no skin {number}")
    skin = _parsed(_Skin, file.gltf.skins[number], where)
    for joint in skin.joints:
        if joint not in nodes:
            raise ValueError(f"{where}: joint {joint} is no node of the scene")
    count = len(skin.joints)
    inverse_bind = np.broadcast_to(np.eye(4), (count, 4, 4))
    if skin.inverse_bind_matrices is not None:
        given = values_of(file, skin.inverse_bind_matrices, ("MAT4",), f"{where}.matrices")
        if len(given) < count:
            raise ValueError(f"{where}: {len(given)} inverse bind matrices for {count} joints")
        inverse_bind = given[:count].reshape(count, 4, 4).transpose(0, 2, 1)
    return Bones(np.array(skin.joints, np.int64), inverse_bind)


def _check_joints(gltf: Gltf) -> None:
    """Raise ValueError where vertices of skins have no usable joints or weights."""
    for number, mesh in enumerate(gltf.meshes):
        for primitive in mesh.primitives:
            for influence in INFLUENCES:
                names = [f"{kind}_{influence}" for kind in ("JOINTS", "WEIGHTS")]
                given = [name for name in names if name in primitive.attributes]
                where = f"meshes[{number}]"
                if len(given) == 1:
                    raise ValueError(f"{where}: {given[0]} without the other of {', '.join(names)}")
                count = gltf.accessors[primitive.attributes["POSITION"]].count
                for name in given:
                    index = primitive.attributes[name]
                    found = accessor_of(gltf, index, ("VEC4",), f"{where}.{name}").count
                    if found != count:
                        raise ValueError(f"{where}.{name}: {found} of VEC4; expected {count}")


def values_of(file: MeshFile, index: int, types: tuple[str, ...], where: str) -> Float:
    """(count, columns) finite numbers of an accessor; matrices are rows of 16, column by column.

    Raises
    ------
    ValueError
        It is of none of these types, is not there, or does not lie in its buffer.
    """
    gltf = file.gltf
    assert gltf is not None
    accessor = accessor_of(gltf, index, types, where)
    assert accessor.buffer_view is not None
    # That accessors lie in their views and these in what buffers claim is known (gltf_check.py).
    view = gltf.buffer_views[accessor.buffer_view]
    data = file.buffer(view.buffer)
    if view.byte_offset + view.byte_length > len(data):
        raise ValueError(f"{where}: buffer {view.buffer} is cut off")
    dtype = np.dtype(_DTYPES[accessor.component_type])
    stored = np.ndarray(
        (accessor.count, _COLUMNS[accessor.type]),
        dtype,
        data,
        view.byte_offset + accessor.byte_offset,
        (view.byte_stride or accessor.item_bytes, dtype.itemsize),
    )
    values = stored.astype(np.float64)
    if accessor.normalized and dtype.kind in "iu":
        values = np.maximum(values / np.iinfo(dtype).max, -1.0)
    if not np.isfinite(values).all():
        raise ValueError(f"{where}: holds NaN or infinity")
    return values


def _unit(quaternions: Float, where: str) -> Float:
    length = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    if not (length > 1e-6).all():
        raise ValueError(f"{where}: a quaternion of no length")
    return np.asarray(quaternions / length)


def _parsed(model: type[Model], value: Any, where: str) -> Model:
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise ValueError(first_fault(error, where)) from None
