"""Rasterization of the virtual objects into depth layers, in both projections (OpenGL 3.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import Projection, View
from iprt.geometry.material import Material
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Instance
from iprt.raster.context import bind_textures, create_context, set_uniforms
from iprt.raster.geometry import Part, WorldGeometry
from iprt.raster.images import reading
from iprt.raster.layers import COVERAGE_TOLERANCE, SAMPLES, Layer, ObjectLayers, blank_display
from iprt.raster.programs import Programs
from iprt.raster.region import Rect, box_rects, merge
from iprt.raster.targets import Target, Targets, texture_bytes

_TILE = 512
"""Tile size in pixels. Coverage is rendered in tiles, so that its target stays small."""


@dataclass(frozen=True)
class _Frame:
    """The state of one call of `render`.

    Attributes
    ----------
    visible : list of (Part, list of Rect)
        Instances that the view may show, with the rectangles that bound them.
    regions : list of Rect
        Disjoint rectangles that cover them all.
    """

    programs: Programs
    targets: Targets
    visible: list[tuple[Part, list[Rect]]]
    regions: list[Rect]


class Rasterizer:
    """A rasterizer of virtual objects, seen from the capture centre.

    It runs these passes per view:

    1. visibility: the nearest front-facing and the nearest back-facing triangle per pixel centre;
    2. shade: normal, distance and albedo of both layers, by intersecting the pixel's ray with the
       triangle;
    3. sub-sampled distances, for display only;
    4. finish, for display only: coverage against the real scene, borrowed edge pixels, motion
    vectors.

    Only rectangles around objects are touched.

    Parameters
    ----------
    instances : sequence of Instance
        Their meshes and textures are uploaded.
    samples : int
        Coverage samples along each side of a pixel.

    Attributes
    ----------
    materials : tuple of Material
        Concatenated materials of all instances; `Layer.material[..., 3] - 1` indexes their
        `table_rows`.
    material_object : (M,) int32
        Index of the instance that each material of the `table_rows` belongs to.
    memory : dict of str to int
        Bytes of device memory by name; always the same dict.

    Raises
    ------
    DeviceError
        EGL or OpenGL 3.3 is missing.
    SceneError
        A transform is not 4x4 finite numbers, or there are more than 2^24 triangles.
    """

    def __init__(self, instances: Sequence[Instance], samples: int = SAMPLES) -> None:
        self._context = create_context()
        self._samples_a_side = samples
        self._deforming = any(instance.mesh.deforms for instance in instances)
        self._needs = MaterialNeeds.of(m for instance in instances for m in instance.mesh.materials)
        with self._context:
            self._geometry = WorldGeometry(self._context, instances)
            self._samples = self._context.depth_texture((_TILE * samples,) * 2)
            self._samples.compare_func = ""
            self._samples.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._samples_target = self._context.framebuffer(depth_attachment=self._samples)
            self._surface = self._context.texture((1, 1), 4, bytes(16), dtype="f4")
        self.materials: tuple[Material, ...] = self._geometry.materials
        self.material_object: NDArray[np.int32] = self._geometry.material_object
        triangles, textures = self._geometry.nbytes
        self.memory = {
            "OpenGL triangles": triangles,
            "OpenGL textures": textures,
            "OpenGL samples": texture_bytes(self._samples),
            "OpenGL surface": texture_bytes(self._surface),
        }
        self._programs: dict[Projection, Programs] = {}
        self._targets: dict[Projection, Targets] = {}

    def move(self, instances: Sequence[Instance]) -> None:
        """Start a frame with new transforms and vertices; the current ones become previous ones.

        Call it once per frame while objects move, and once more when they stop: motion is measured
        from the state before the last call.

        Parameters
        ----------
        instances : sequence of Instance
            The same objects, in the same order; only meshes that deform may have other vertices.

        Raises
        ------
        SceneError
            A transform is not 4x4 finite numbers.
        """
        with self._context:
            self._geometry.move(instances)

    def set_surface(self, surface: NDArray[np.float32]) -> None:
        """Set the real scene that `coverage` compares with; initially there is none.

        Parameters
        ----------
        surface : (H, W, 4) float32
            Panorama; xyz = g such that the real surface is at radial distance 1 / (g . d) along the
            unit direction d (0 where there is none); finite. w is not read.
        """
        height, width = surface.shape[:2]
        with self._context:
            if self._surface.size != (width, height):
                self._surface.release()
                self._surface = self._context.texture((width, height), 4, dtype="f4")
                self.memory["OpenGL surface"] = texture_bytes(self._surface)
            self._surface.write(np.ascontiguousarray(surface, np.float32))

    def render(
        self, view: View, previous: View | None = None, *, shade: bool, back: bool = True
    ) -> ObjectLayers:
        """Render the objects' layers in a view.

        Parameters
        ----------
        view : View
            A view of either projection.
        previous : View, optional
            The previous frame's view, of the same projection; by default `view` itself.
        shade : bool
            Add coverage and motion vectors, and borrow surfaces for covered edge pixels.
        back : bool
            Render the back layer, which only screen-space ray marching needs.

        Returns
        -------
        ObjectLayers
            New arrays of the view's size.
        """
        previous = previous or view
        if previous.projection != view.projection:
            raise ValueError("the previous view must have the same projection")
        with self._context:
            return self._render(view, previous, shade=shade, back=back)

    def close(self) -> None:
        """Free the context and all its resources."""
        self._context.release()

    def _render(self, view: View, previous: View, *, shade: bool, back: bool) -> ObjectLayers:
        placed = [(part, box_rects(view, part.corners)) for part in self._geometry.parts]
        visible = [(part, rects) for part, rects in placed if rects]
        if not visible:
            return self._nothing(view, shade=shade)
        regions = merge([rect for _, rects in visible for rect in rects])
        frame = _Frame(self._programs_for(view), self._targets_for(view), visible, regions)
        reach = max(float(np.abs(part.corners).max()) for part in self._geometry.parts)
        uniforms = _view_uniforms(view) | {"depth_scale": max(1e-30, reach / 16.0)}
        for program in vars(frame.programs).values():
            set_uniforms(program, uniforms)
        self._see(frame, back=back)
        targets = frame.targets
        self._shade(frame, [targets.front, targets.back] if back else [targets.front])
        behind = _read(targets.back, regions) if back else None
        if not shade:
            return ObjectLayers(_read(targets.front, regions), behind)

        before = {f"previous_{key}": value for key, value in _view_uniforms(previous).items()}
        set_uniforms(frame.programs.finish, before)
        for region in regions:
            for tile in region.tiles(_TILE):
                self._finish(frame, tile)
        display = self._blank(view)
        for image, pixels in enumerate(display):
            targets.display.read_into(pixels, image, regions)
        return ObjectLayers.displayed(display, behind)

    def _see(self, frame: _Frame, *, back: bool) -> None:
        """Find the nearest front-facing and the nearest back-facing triangles.

        Without the back layer, find the nearest triangles of either orientation.
        """
        program, targets = frame.programs.visibility, frame.targets
        set_uniforms(program, _window(0, 0, 1, targets.size))
        for target, side in ((targets.away, 1), (targets.facing, -1 if back else 0)):
            for region in frame.regions:
                target.framebuffer.clear(depth=0.0, viewport=region.viewport)
            if back or target is targets.facing:
                target.framebuffer.use()
                self._draw(program, [part for part, _ in frame.visible], side)

    def _draw(self, program: moderngl.Program, parts: Sequence[Part], side: int) -> None:
        """Draw triangles into the bound target; `program` knows its window.

        `side` is 1 for back-facing triangles, -1 for front-facing ones, 0 for all. OpenGL culls in
        the perspective projection; the equirect shaders cull themselves.
        """
        context = self._context
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = ">"
        if side != 0 and "side" not in program:
            context.enable(moderngl.CULL_FACE)
            context.cull_face = "front" if side > 0 else "back"
        vertices = context.vertex_array(program, [(self._geometry.positions, "3f", "position")])
        for part in parts:
            # Image rows run downwards, which flips the winding of every triangle.
            context.front_face = "ccw" if part.mirrored else "cw"
            set_uniforms(program, {"side": -side if part.mirrored else side})
            first, count = 3 * part.first_triangle, 3 * len(part.triangles)
            vertices.render(moderngl.TRIANGLES, count, first=first)
        vertices.release()

    def _shade(self, frame: _Frame, layers: Sequence[Target]) -> None:
        """Shade layers from their visible triangles, then again for each textured material."""
        geometry, programs, targets = self._geometry, frame.programs, frame.targets
        textures = {
            "triangles": geometry.triangles,
            "vertices": geometry.vertices,
            "table": geometry.table,
            "seen_facing": targets.facing.images[0],
            "seen_away": targets.away.images[0],
        }
        if geometry.displacements is not None:
            textures["displacements"] = geometry.displacements
        if geometry.tangents is not None:
            textures["tangents"] = geometry.tangents
        if geometry.uvs2 is not None:
            textures["uvs2"] = geometry.uvs2
        for layer in layers:
            which = {"back_layer": layer is targets.back}
            bind_textures(programs.shade, textures)
            self._fill(programs.shade, layer, frame.regions, which)
            for part, rects in frame.visible:
                for index in range(part.materials.start, part.materials.stop):
                    if index in geometry.images:
                        bind_textures(programs.shade_textured, textures | geometry.images[index])
                        textured = {
                            "textured": index,
                            "first_variant": geometry.first_variants[index],
                            **reading(geometry.materials[index]),
                        }
                        self._fill(programs.shade_textured, layer, rects, which | textured)

    def _finish(self, frame: _Frame, tile: Rect) -> None:
        """Render the displayed layer of a tile: sub-sampled distances, then the finish pass."""
        _, _, width, height = tile.viewport
        side = self._samples_a_side
        window = (0, 0, width * side, height * side)
        samples, distances = self._samples_target, frame.programs.distances
        samples.clear(depth=0.0, viewport=window)
        samples.scissor = window
        samples.use()
        set_uniforms(distances, _window(tile.x0, tile.y0, side, samples.size))
        parts = [p for p, rects in frame.visible if any(rect.touches(tile) for rect in rects)]
        self._draw(distances, parts, side=0)

        program, targets = frame.programs.finish, frame.targets
        textures = {
            "geometry_in": targets.front.images[0],
            "material_in": targets.front.images[1],
            "samples": self._samples,
            "surface": self._surface,
            "table": self._geometry.table,
        }
        if self._geometry.displacements is not None:
            textures["displaced_in"] = targets.front.images[2]
        if self._needs.display_images > 3:
            textures["finish_in"] = targets.front.images[2 + self._deforming]
        if self._needs.emission:
            textures["emission_in"] = targets.front.images[-1]
        bind_textures(program, textures)
        self._fill(program, targets.display, [tile], {"samples_origin": (tile.x0, tile.y0)})

    def _fill(
        self,
        program: moderngl.Program,
        target: Target,
        rects: Sequence[Rect],
        uniforms: Mapping[str, Any],
    ) -> None:
        """Run a fragment shader on the pixels of `rects`."""
        framebuffer = target.framebuffer
        set_uniforms(program, {**_window(0, 0, 1, framebuffer.size), **uniforms})
        self._context.enable_only(moderngl.NOTHING)
        vertices = self._context.vertex_array(program, [])
        for rect in rects:
            framebuffer.scissor = rect.viewport
            framebuffer.use()
            vertices.render(moderngl.TRIANGLES, 3)
        vertices.release()

    def _programs_for(self, view: View) -> Programs:
        if view.projection not in self._programs:
            self._programs[view.projection] = Programs.build(
                self._context,
                view.projection,
                samples=self._samples_a_side,
                deforming=self._deforming,
                needs=self._needs,
            )
        return self._programs[view.projection]

    def _targets_for(self, view: View) -> Targets:
        """Return targets of the view's size; one set per projection is kept."""
        size = (view.width, view.height)
        held = self._targets.get(view.projection)
        if held is not None and held.size == size:
            return held
        if held is not None:
            held.release()
        targets = Targets.create(self._context, size, deforming=self._deforming, needs=self._needs)
        self._targets[view.projection] = targets
        self.memory[f"OpenGL layers, {view.projection}"] = targets.nbytes
        return targets

    def _blank(self, view: View) -> NDArray[np.float32]:
        return blank_display(self._needs.display_images, view.height, view.width)

    def _nothing(self, view: View, *, shade: bool) -> ObjectLayers:
        empty = Layer(*np.zeros((2, view.height, view.width, 4), np.float32))
        if not shade:
            return ObjectLayers(empty, empty)
        return ObjectLayers.displayed(self._blank(view), empty)


def _view_uniforms(view: View) -> dict[str, Any]:
    return {
        "world_from_view": tuple(view.world_from_view.T.ravel()),  # columns
        "focal_px": view.focal_px,
        "view_size": (view.width, view.height),
        "tolerance": COVERAGE_TOLERANCE,
    }


def _window(x: int, y: int, samples_per_pixel: int, size: tuple[int, int]) -> dict[str, Any]:
    """Return the uniforms of a target of `size` samples whose first sample lies in pixel (x, y)."""
    return {"window": (x, y, samples_per_pixel), "target_size": size}


def _read(layer: Target, regions: Sequence[Rect]) -> Layer:
    return Layer(layer.read(0, regions), layer.read(1, regions))
