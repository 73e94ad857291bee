"""Auxiliary pictures of a rendered frame, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import pyopencl.array as cla

from iprt.compositing.object_layer import VisibleLayer
from iprt.compositing.real_layer import UNEVEN, RealLayer
from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.light_view import LightView
from iprt.method import Image, Method, Signals, in_front
from iprt.world.real.real_world import RealWorld


class RenderedView(Protocol):
    """Source of auxiliary pictures: a `Renderer` after a frame, which documents the attributes."""

    device: ComputeDevice
    layout: PlaneLayout
    view: View
    real: RealLayer
    real_world: RealWorld
    visible: VisibleLayer | None
    method: Method | None
    light: LightView | None

    @property
    def signals(self) -> Signals:
        """Components of the picture."""


Reader = Callable[[RenderedView], Image | None]


def _planes(renderer: RenderedView, planes: cla.Array | None, channels: slice) -> Image | None:
    if planes is None:
        return None
    return renderer.layout.image(renderer.device.read(planes), channels)


def _visible(name: str, channels: slice) -> Reader:
    """Return a reader of planes of the visible objects."""

    def image(renderer: RenderedView) -> Image | None:
        visible = renderer.visible
        return _planes(renderer, getattr(visible, name), channels) if visible else None

    return image


def _mixed(name: str, channels: slice) -> Reader:
    """Return a reader of real planes, replaced by the objects' where they cover half of a pixel."""

    def image(renderer: RenderedView) -> Image | None:
        real = _planes(renderer, getattr(renderer.real, name), channels)
        coverage = _visible("coverage", slice(0, 1))(renderer)
        return in_front(coverage, _visible(name, channels)(renderer), real)

    return image


def _reflected(name: str) -> Reader:
    def image(renderer: RenderedView) -> Image | None:
        shown = _planes(renderer, getattr(renderer.signals, name), slice(0, 3))
        coverage = _visible("coverage", slice(0, 1))(renderer)
        if shown is None or coverage is None:
            return None
        # Beside objects nothing is filtered, and planes hold old values.
        return np.where(coverage[..., None] > 0.0, shown, np.float32(0.0))

    return image


def _ratio(renderer: RenderedView) -> Image | None:
    if renderer.signals.ratio is None:
        return None
    shape = (renderer.view.height, renderer.view.width, 4)
    ratio: Image = renderer.device.read(renderer.signals.ratio).reshape(shape)[..., :3]
    second = renderer.device.read(renderer.real.other_pixel).reshape(shape[:2])
    share = renderer.device.read(renderer.real.other).reshape(shape)
    corner = renderer.device.read(renderer.real.corner).reshape(shape)
    edge, uneven, flat = second >= 0, second == UNEVEN, ratio.reshape(-1, 3)
    applied = ratio.copy()
    applied[edge] += share[edge, :3] * (flat[second[edge]] - ratio[edge])
    others = flat[corner[uneven]] - ratio[uneven][:, None]
    applied[uneven] += (share[uneven][..., None] * others).sum(axis=1)
    return applied


def _background(renderer: RenderedView) -> Image | None:
    return _planes(renderer, renderer.real.color, slice(0, 3))


def _gloss(renderer: RenderedView) -> Image | None:
    return _planes(renderer, renderer.signals.change, slice(0, 3))


def _highlight(renderer: RenderedView) -> Image | None:
    if renderer.signals.change is None:
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


def _of_method(name: str) -> Reader:
    """Return a reader of a picture that only some methods have."""

    def image(renderer: RenderedView) -> Image | None:
        found = renderer.method.aov(name) if renderer.method else None
        light = renderer.light
        return found if found is None or light is None else light.repeated(found)

    return image


AOVS: dict[str, Reader] = {
    "background": _background,
    "normal": _normal,
    "depth": _mixed("depth", slice(0, 1)),
    "albedo": _visible("albedo", slice(0, 3)),
    "coverage": _visible("coverage", slice(0, 1)),
    "motion": _mixed("motion", slice(0, 2)),
    "ratio": _ratio,
    "irradiance_real": _of_method("irradiance_real"),
    "irradiance_mixed": _of_method("irradiance_mixed"),
    "diffuse": _reflected("diffuse"),
    "specular": _reflected("specular"),
    "highlight": _highlight,
    "gloss": _gloss,
    "tracing_level": _of_method("tracing_level"),
    "hit_distance": _of_method("hit_distance"),
    "history_length": _of_method("history_length"),
    "variance": _of_method("variance"),
    "learned": _of_method("learned"),
}
"""Name -> reader. background: radiance without objects; normal (world) and depth (metres from the
capture centre) of visible surfaces; albedo and coverage of the objects; motion: x and y, in pixels,
of the visible surface in the previous frame, -1e9: nowhere; ratio: E_RV / E_R; irradiance_*: E_R
and E_RV over pi, without a sun that the panorama does not show; diffuse: light that the albedo
multiplies; specular: radiance; highlight: reflection of glossy real surfaces towards the camera, in
the background; gloss: its change by objects; tracing_level: 0, 1, 2, and 255 where nothing is
traced; hit_distance: metres from objects to the surface they reflect specularly, 1e6: the sky, 0:
none; history_length: temporal mean's effective number of frames with all their rays; variance: of
the luminance of that mean, which guides the spatial filter (of real surfaces: the change by
objects, as a fraction of E_R with `iprt`, over pi with `iprt2023`; of objects: the sum of diffuse
and specular light); learned: radiance of real surfaces as learned by `oil`, 0 where unknown. All
but the background is in the colors of the video's reference frame (see
`iprt.footage.prepare.exposure`)."""


def read_aov(renderer: RenderedView, name: str) -> Image:
    """Return a picture, (H, W) or (H, W, 3) float32; zeros if the scene needs no such pass.

    Raises
    ------
    KeyError
        No auxiliary picture has that name.
    """
    image = AOVS[name](renderer)
    if image is None:
        return np.zeros((renderer.view.height, renderer.view.width), np.float32)
    return image
