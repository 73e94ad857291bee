"""An animation of a glTF file, checked and read: node tracks and the joints of skins.

Specification: Khronos glTF 2.0, section 3.11 (animations). pydantic checks the document's shape.
Only the chosen animation and the skins that it deforms are read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from iprt.errors import FormatError
from iprt.files.message_text import printable
from iprt.geometry.animation import Float, Skeleton, Track
from iprt.geometry.gltf_document import MAX_PARTS, Gltf, parsed_part
from iprt.geometry.gltf_part import Index, Part
from iprt.geometry.gltf_skin import Bones, read_bones, scene_nodes, unit_quaternions
from iprt.geometry.mesh_files import MeshFile

MAX_NAMES = 20
"""Limit of the animations that an error message lists."""
_TYPES = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}


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


@dataclass(frozen=True)
class Clip:
    """An animation.

    Attributes
    ----------
    duration : float
        Seconds from 0 to the last key, after which the animation loops.
    skeleton : Skeleton
        All nodes of the scene.
    bones : dict of int to Bones
        By index of the skin.
    """

    name: str
    duration: float
    skeleton: Skeleton
    bones: dict[int, Bones]

    def pose(self, time_s: float) -> dict[int, Float]:
        """Return each node's (4, 4) transform to world space at a time in seconds."""
        return self.skeleton.pose(time_s % self.duration if self.duration > 0.0 else 0.0)


def read_clip(file: MeshFile, choice: str | int, dropped: list[str]) -> Clip:
    """Read an animation by name or index, and append its unread parts to `dropped`.

    Raises
    ------
    FormatError
        The file has no such animation.
    ValueError
        The animation is damaged; the message is one line.
    """
    gltf = file.gltf
    if gltf is None or not gltf.animations:
        raise FormatError(f"{file.path}: has no animations; leave `animation` out")
    number = _chosen(file, gltf, choice)
    where = f"animations[{number}]"
    animation = parsed_part(_Animation, gltf.animations[number], where)
    nodes = scene_nodes(gltf)
    tracks: dict[int, dict[str, Track]] = {}
    samplers: dict[tuple[int, str], Track] = {}
    for index, channel in enumerate(animation.channels):
        node, path = channel.target.node, channel.target.path
        if path not in _TYPES:
            dropped.append("animated morph targets" if path == "weights" else "animated extensions")
            continue
        if node is None or node not in nodes:
            continue  # of an extension, or in another scene
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
    bones = read_bones(file, nodes)
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
    """Return the index and name of each of the first `MAX_NAMES` animations: `0 ('walk')`."""
    return [
        f"{number} ('{printable(name)}')" if isinstance(name, str) else f"{number}"
        for number, name in enumerate(_names(gltf)[:MAX_NAMES])
    ]


def _names(gltf: Gltf) -> list[object]:
    return [entry.get("name") if isinstance(entry, dict) else None for entry in gltf.animations]


def _track(file: MeshFile, sampler: _Sampler, path: str, where: str) -> Track:
    times = file.values(sampler.input, ("SCALAR",), f"{where}.input")[:, 0]
    values = file.values(sampler.output, (_TYPES[path],), f"{where}.output")
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
        keys[:] = unit_quaternions(keys, f"{where}.output")
    held = np.full(len(times), sampler.interpolation == "STEP")
    return Track(times, values, held, rotation=path == "rotation")
