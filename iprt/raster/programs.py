"""The shader programs of each projection."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from iprt.geometry.camera import Projection
from iprt.geometry.material_needs import MaterialNeeds
from iprt.raster.context import load_program


@dataclass(frozen=True)
class Programs:
    """The shader programs of one projection.

    Attributes
    ----------
    visibility, distances : moderngl.Program
        Draw triangles: index of the nearest one; depth alone.
    shade, shade_textured, finish : moderngl.Program
        Full-screen passes: a layer; its surfaces with one texture; the displayed layer.
    """

    visibility: moderngl.Program
    distances: moderngl.Program
    shade: moderngl.Program
    shade_textured: moderngl.Program
    finish: moderngl.Program

    @classmethod
    def build(
        cls,
        context: moderngl.Context,
        projection: Projection,
        *,
        samples: int,
        deforming: bool,
        needs: MaterialNeeds,
    ) -> Programs:
        """Build the programs of a projection.

        Parameters
        ----------
        samples : int
            Coverage samples along each side of a pixel.
        deforming : bool
            Some meshes deform.
        needs : MaterialNeeds
            Needs of the materials.
        """
        defines = {"EQUIRECT": 1} if projection == "equirect" else {}
        more = {"DEFORMING": 1} if deforming else {}
        if needs.display_images > 3:
            more |= {"PRINCIPLED": 1, "FINISH_IMAGE": 3 if deforming else 2}
        if needs.emission:
            more |= {"EMISSION": 1, "EMISSION_IMAGE": 4 if deforming else 3}
        maps = {"NORMAL_MAPS": 1} if needs.normal_maps else {}
        maps |= {"VARIANTS": 1} if needs.variants else {}
        maps |= {"TEXTURE_PLACES": 1} if needs.texture_places else {}
        stages = f"visibility_{projection}"

        def visibility(**extra: int) -> moderngl.Program:
            return load_program(
                context,
                f"{stages}.frag",
                vertex=f"{stages}.vert",
                geometry=f"{stages}.geom" if projection == "equirect" else None,
                defines=defines | extra,
            )

        def screen(fragment: str, **extra: int) -> moderngl.Program:
            return load_program(context, fragment, vertex="screen.vert", defines=defines | extra)

        return cls(
            visibility(),
            visibility(DEPTH_ONLY=1),
            screen("shade.frag", **more),
            screen("shade.frag", TEXTURED=1, **more, **maps),
            screen("finish.frag", SAMPLES=samples, **more),
        )
