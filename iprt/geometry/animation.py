"""Animation: keyframe tracks, node hierarchies and skins.

Quaternions are (x, y, z, w) and of unit length. References are to the glTF 2.0 specification
(Khronos Group): Appendix C defines interpolation, section 3.7.3 defines skins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.geometry.mesh import cofactors

Float = NDArray[np.float64]
NO_ROTATION = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Track:
    """A keyframed quantity, constant before its first key and after its last.

    Attributes
    ----------
    times : (K,) float64
        Seconds, strictly ascending; at least one.
    values : (K, C) float64, or (K, 3, C)
        Values at `times`. (K, 3, C) holds cubic splines: in-tangent, value, out-tangent.
    held : (K,) bool
        True where the value is held until the next key (step interpolation).
    rotation : bool
        Values are quaternions, interpolated by slerp along the shorter arc.
    """

    times: Float
    values: Float
    held: NDArray[np.bool_]
    rotation: bool = False

    def at(self, time_s: float) -> Float:
        """Return the (C,) value at a time in seconds; at a key it is exactly the key's value."""
        key = int(np.searchsorted(self.times, time_s, side="right")) - 1
        last = len(self.times) - 1
        if key < 0 or key == last or self.held[key] or time_s == self.times[key]:
            return self._key(max(key, 0))
        duration = float(self.times[key + 1] - self.times[key])
        return self._between(key, float(time_s - self.times[key]) / duration, duration)

    def _between(self, key: int, part: float, duration: float) -> Float:
        """Interpolate from a key to the next one, at a part of the seconds between them."""
        if self.values.ndim == 3:
            return self._spline(key, part, duration)
        before, after = self.values[key], self.values[key + 1]
        if self.rotation:
            turns = scipy.spatial.transform.Rotation.from_quat([before, after])
            return np.asarray(scipy.spatial.transform.Slerp([0.0, 1.0], turns)(part).as_quat())
        return np.asarray(before + part * (after - before))

    def _key(self, key: int) -> Float:
        return np.asarray(self.values[key] if self.values.ndim == 2 else self.values[key, 1])

    def _spline(self, key: int, s: float, duration: float) -> Float:
        """Interpolate between two keys by a cubic Hermite spline (glTF 2.0, Appendix C.5)."""
        (_, start, leaving), (arriving, end, _) = self.values[key], self.values[key + 1]
        value: Float = (
            (2 * s**3 - 3 * s**2 + 1) * start
            + duration * (s**3 - 2 * s**2 + s) * leaving
            + (3 * s**2 - 2 * s**3) * end
            + duration * (s**3 - s**2) * arriving
        )
        if not self.rotation:
            return value
        length = float(np.linalg.norm(value))
        return value / length if length > 1e-9 else start


def transform(translation: Sequence[float] | Float, rotation: Float, scale: Float) -> Float:
    """Return the (4, 4) matrix that scales by (3,), rotates by (4,), then translates by (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = scipy.spatial.transform.Rotation.from_quat(rotation).as_matrix() * scale
    matrix[:3, 3] = translation
    return matrix


@dataclass(frozen=True)
class Node:
    """A coordinate frame relative to its parent.

    Attributes
    ----------
    parent : int
        Index of the parent node, or -1 for a root.
    translation : (3,) float64
    rotation : (4,) float64
    scale : (3,) float64
    matrix : (4, 4) float64 or None
        Replaces translation, rotation and scale.
    """

    parent: int
    translation: Float = field(default_factory=lambda: np.zeros(3))
    rotation: Float = field(default_factory=lambda: np.array(NO_ROTATION))
    scale: Float = field(default_factory=lambda: np.ones(3))
    matrix: Float | None = None

    def local(self, tracks: Mapping[str, Track], time_s: float) -> Float:
        """Return the (4, 4) transform to the parent's frame.

        `tracks` may hold a track each for "translation", "rotation" and "scale".
        """
        if self.matrix is not None and not tracks:
            return self.matrix
        parts = (
            tracks[name].at(time_s) if name in tracks else getattr(self, name)
            for name in ("translation", "rotation", "scale")
        )
        return transform(*parts)


@dataclass(frozen=True)
class Skeleton:
    """A hierarchy of animated nodes.

    Attributes
    ----------
    nodes : dict of int to Node
        By index, parents before their children.
    tracks : dict of int to (dict of str to Track)
        By node index, then by "translation", "rotation" or "scale".
    """

    nodes: Mapping[int, Node]
    tracks: Mapping[int, Mapping[str, Track]]

    def pose(self, time_s: float) -> dict[int, Float]:
        """Return the (4, 4) transform from each node's frame to the frame of the roots."""
        placed: dict[int, Float] = {}
        for index, node in self.nodes.items():
            local = node.local(self.tracks.get(index, {}), time_s)
            placed[index] = local if node.parent < 0 else placed[node.parent] @ local
        return placed


@dataclass(frozen=True)
class Skin:
    """Vertices that follow several nodes (linear blend skinning).

    Attributes
    ----------
    nodes : (J,) int64
        Node indices of the joints.
    inverse_bind : (J, 4, 4) float64
        Transforms from mesh space to each joint's space in the bind pose.
    joints : (V, I) int64
        Indices into `nodes` of the joints of each vertex.
    weights : (V, I) float64
        Weights of these joints; rows sum to 1.
    """

    nodes: NDArray[np.int64]
    inverse_bind: Float
    joints: NDArray[np.int64]
    weights: Float

    def matrices(self, pose: Mapping[int, Float]) -> Float:
        """Return the (V, 3, 4) transforms from mesh space to the frame of the roots."""
        bones = np.stack([pose[int(node)] for node in self.nodes]) @ self.inverse_bind
        blended = np.zeros((len(self.joints), 3, 4))
        for joint, weight in zip(self.joints.T, self.weights.T, strict=True):
            blended += weight[:, None, None] * bones[joint, :3]
        return blended


def moved(
    positions: NDArray[np.floating], normals: NDArray[np.floating], matrices: Float
) -> tuple[Float, Float]:
    """Transform vertices by affine maps.

    Parameters
    ----------
    positions, normals : (V, 3)
    matrices : (V, 3, 4) or (1, 3, 4) float64
        One map for each vertex, or one for all.

    Returns
    -------
    (V, 3), (V, 3) float64
        Positions and unit normals. Normals go by the inverse transpose, and stay unchanged where a
        singular map leaves them no length.
    """
    linear, offset = matrices[:, :, :3], matrices[:, :, 3]
    points = np.einsum("vij,vj->vi", _for_each(linear, positions), positions) + offset
    side = np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0)[:, None, None]
    turned = np.einsum("vij,vj->vi", _for_each(side * cofactors(linear), normals), normals)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    unit = np.array(normals, np.float64)
    np.divide(turned, length, out=unit, where=length > 0.0)
    return points, unit


def _for_each(matrices: Float, vectors: NDArray[np.floating]) -> Float:
    return np.broadcast_to(matrices, (len(vectors), *matrices.shape[1:]))
