"""Auxiliary pictures of a rendered frame, by name."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Protocol

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.filter.temporal import Accumulated, Kind
from iprt.gbuffer.guide import Guide
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.methods.gloss_pixels import GlossPixels
from iprt.methods.pixels import RealPixels, VirtualPixels
from iprt.view.real_layer import RealLayer
from iprt.world.real.real_world import RealWorld

Image = NDArray[np.float32]


class RenderedView(Protocol):
    """What auxiliary pictures are read from: a `Renderer` after a frame, see there."""

    device: ComputeDevice
    layout: PlaneLayout
    view: View
    real: RealLayer
    real_world: RealWorld
    real_guide: Guide
    real_pixels: RealPixels | None
    gloss_pixels: GlossPixels | None
    virtual_pixels: VirtualPixels | None


Reader = Callable[[RenderedView], Image | None]


def _planes(renderer: RenderedView, planes: cla.Array | None, channels: slice) -> Image | None:
    if planes is None:
        return None
    image = renderer.layout.interior(renderer.device.read(planes))[channels].astype(np.float32)
    return np.ascontiguousarray(image[0] if len(image) == 1 else np.moveaxis(image, 0, -1))


def _visible(name: str, channels: slice) -> Reader:
    """Planes of the visible objects."""

    def image(renderer: RenderedView) -> Image | None:
        pixels = renderer.virtual_pixels
        return _planes(renderer, getattr(pixels.visible, name), channels) if pixels else None

    return image


def _mixed(name: str, channels: slice) -> Reader:
    """Planes of the real layer, replaced by the objects' where they cover half of the pixel."""

    def image(renderer: RenderedView) -> Image | None:
        real = _planes(renderer, getattr(renderer.real, name), channels)
        return _in_front(renderer, _visible(name, channels)(renderer), real)

    return image


def _in_front(renderer: RenderedView, virtual: Image | None, real: Image | None) -> Image | None:
    """`virtual` where objects cover half of the pixel, else `real`; None of one counts as 0."""
    coverage = _visible("coverage", slice(0, 1))(renderer)
    if virtual is None or coverage is None:
        return real
    front = coverage > 0.5
    behind = np.zeros_like(virtual) if real is None else real
    return np.where(front if virtual.ndim == 2 else front[..., None], virtual, behind)


def _history_length(renderer: RenderedView) -> Image | None:
    def length(accumulated: Accumulated) -> Image | None:
        return _planes(renderer, accumulated.length, slice(0, 1))

    return _of_signals(renderer, length, np.minimum)


def _variance(renderer: RenderedView) -> Image | None:
    def variance(accumulated: Accumulated) -> Image | None:
        return _planes(renderer, accumulated.variance, slice(0, 1))

    return _of_signals(renderer, variance, np.add)


def _of_signals(
    renderer: RenderedView, read: Callable[[Accumulated], Image | None], both: np.ufunc
) -> Image | None:
    """An auxiliary layer; `both` joins what was read of diffuse and specular light of objects."""
    objects, surfaces = renderer.virtual_pixels, renderer.real_pixels
    signals = objects.accumulated if objects else ()
    virtual = functools.reduce(both, map(read, signals)) if signals else None
    accumulated = surfaces.accumulated if surfaces else None
    return _in_front(renderer, virtual, read(accumulated) if accumulated else None)


def _hit_distance(renderer: RenderedView) -> Image | None:
    pixels = renderer.virtual_pixels
    met = _planes(renderer, pixels.hit, slice(0, 1)) if pixels else None
    # Beside objects, where no rays start, the plane holds what was there before.
    return _in_front(renderer, met, None)


def _irradiance_real(renderer: RenderedView) -> Image | None:
    pixels, cache = renderer.real_pixels, renderer.real_world.irradiance
    if pixels is None or pixels.change is None:
        return None
    shown = (
        pixels.change
        if cache is None
        else cache.show(renderer.real_world.panorama, renderer.real_guide)
    )
    return _planes(renderer, shown, slice(0, 3))


def _irradiance_mixed(renderer: RenderedView) -> Image | None:
    pixels, real = renderer.real_pixels, _irradiance_real(renderer)
    if pixels is None or real is None:
        return None
    second = _planes(renderer, pixels.change, slice(3, 6))
    blocked = _planes(renderer, pixels.change, slice(0, 3))
    if renderer.real_world.irradiance is None or blocked is None or second is None:
        return second
    return np.asarray(real * (1.0 - blocked + second), np.float32)


def _reflected(kind: Kind) -> Reader:
    def image(renderer: RenderedView) -> Image | None:
        pixels = renderer.virtual_pixels
        planes = pixels.reflected.get(kind) if pixels else None
        shown = _planes(renderer, planes, slice(0, 3))
        coverage = _visible("coverage", slice(0, 1))(renderer)
        if shown is None or coverage is None:
            return None
        # Beside objects, where nothing is filtered, planes hold what was there before.
        return np.where(coverage[..., None] > 0.0, shown, np.float32(0.0))

    return image


def _tracing_level(renderer: RenderedView) -> Image | None:
    pixels = renderer.real_pixels
    return _planes(renderer, pixels.mask.level, slice(0, 1)) if pixels else None


def _ratio(renderer: RenderedView) -> Image | None:
    if renderer.real_pixels is None:
        return None
    shape = (renderer.view.height, renderer.view.width, 4)
    ratio: Image = renderer.device.read(renderer.real_pixels.relight.ratio).reshape(shape)
    return np.ascontiguousarray(ratio[..., :3])


def _background(renderer: RenderedView) -> Image | None:
    return _planes(renderer, renderer.real.color, slice(0, 3))


def _gloss(renderer: RenderedView) -> Image | None:
    pixels = renderer.gloss_pixels
    return _planes(renderer, pixels.change, slice(0, 3)) if pixels else None


def _highlight(renderer: RenderedView) -> Image | None:
    if renderer.gloss_pixels is None:
        return None
    seen = _background(renderer)
    diffuse = _planes(renderer, renderer.real.diffuse, slice(0, 3))
    if seen is None or diffuse is None:
        return None
    color_map = renderer.real_world.frame.color_map
    seen = seen if color_map is None else seen @ color_map.T.astype(np.float32)
    return np.asarray(seen - diffuse)


def _normal(renderer: RenderedView) -> Image | None:
    normal = _mixed("normal", slice(0, 3))(renderer)
    pose = renderer.real_world.frame.pose
    return (
        normal if normal is None or pose is None else (normal @ pose[:3, :3].T).astype(np.float32)
    )


AOVS: dict[str, Reader] = {
    "background": _background,
    "normal": _normal,
    "depth": _mixed("depth", slice(0, 1)),
    "albedo": _visible("albedo", slice(0, 3)),
    "coverage": _visible("coverage", slice(0, 1)),
    "motion": _mixed("motion", slice(0, 2)),
    "ratio": _ratio,
    "irradiance_real": _irradiance_real,
    "irradiance_mixed": _irradiance_mixed,
    "diffuse": _reflected("diffuse"),
    "specular": _reflected("specular"),
    "highlight": _highlight,
    "gloss": _gloss,
    "tracing_level": _tracing_level,
    "hit_distance": _hit_distance,
    "history_length": _history_length,
    "variance": _variance,
}
"""Name -> what reads it back. background: radiance without objects; normal (world) and depth
(metres from the capture centre) of what is seen; albedo and coverage of the objects; motion: x and
y in pixels of where what is seen was in the frame before, -1e9: nowhere; ratio: E_RV / E_R;
irradiance_*: E_R and E_RV over pi; diffuse: what the albedo is multiplied by; specular: radiance;
highlight: what glossy real surfaces reflect towards the camera, of the background; gloss: what
objects change in it; tracing_level: 0, 1, 2, and 255 where nothing is traced;
hit_distance: metres from objects to what they reflect specularly, 1e6: the sky, 0: nothing;
history_length: frames with all their rays that the temporal mean is worth; variance: of the
luminance of that mean, which guides the spatial filter (of real surfaces: what objects change, as a
fraction of E_R with the estimator "delta", over pi with "ratio"; of objects: of diffuse and
specular light, added up). All but the background is in the colours of the video's reference frame
(`iprt.footage.drift`), where the frame's differ."""


def read_aov(renderer: RenderedView, name: str) -> Image:
    """(H, W) or (H, W, 3) float32; zeros where the scene requires no such pass.

    Raises
    ------
    KeyError
        No auxiliary picture has that name.
    """
    image = AOVS[name](renderer)
    if image is None:
        return np.zeros((renderer.view.height, renderer.view.width), np.float32)
    return image
