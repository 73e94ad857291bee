"""`iprt reference`: a path-traced reference picture of a view, by an independent renderer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from iprt.commands.flag_types import Size
from iprt.commands.standard_streams import reporting
from iprt.commands.views import choose_view
from iprt.errors import IprtError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from iprt.geometry.camera import View
    from iprt.geometry.mesh import Instance

    Layers = tuple[NDArray[np.float32], dict[str, NDArray[np.float32]]]


def reference(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=("-o",))],
    view: str | None = None,
    size: Size = None,
    spp: int = 256,
    seed: int = 0,
    denoise: bool = True,
    model: str | None = None,
    allow_outside: bool = False,
) -> int:
    """Path-trace a view of a scene with Mitsuba, to a linear EXR file.

    Without --model, the objects are traced in the scene that the panorama describes, which is what
    the renderer approximates; the layers are ratio, background, objects and coverage. With --model,
    they are traced in the full geometry of the scene, which gives the ground truth; the layers are
    background and coverage. Needs the extra `reference`: pip install 'iprt[reference]'.

    Parameters
    ----------
    scene
        Scene folder.
    output
        EXR file to write.
    view
        Name of a view of the scene, or `equirect` for the whole panorama. Default: the scene's
        first view.
    size
        Width and height in pixels. Default: the view's own.
    spp
        Samples (paths) per pixel.
    seed
        Seed of the random numbers.
    denoise
        Do not denoise. By default, Open Image Denoise removes what noise is left.
    model
        Python module with a function `build()` that returns the scene's parts for Mitsuba, such as
        `scenes360.room.model`; looked for in the working directory too.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.output.picture import check_output

    if output.suffix.lower() != ".exr":
        raise IprtError(f"{output}: a reference is written as .exr")
    if not 1 <= spp <= 2**16:
        raise IprtError(f"--spp {spp}: expected 1 to {2**16}")
    if not 0 <= seed < 2**31:
        raise IprtError(f"--seed {seed}: expected 0 to {2**31 - 1}")
    check_output(output)

    from iprt.output.picture import write_exr
    from iprt.scene.scene import Scene
    from iprt.truth.backend import mitsuba

    opened = Scene.open(scene, allow_outside=allow_outside)
    opened.require_not_ours(output)
    chosen, instances = choose_view(opened, view, size=size)
    mitsuba()  # report a missing package before anything is read
    if model is not None:
        from iprt.truth.model import load_parts

        color, layers = _with_model(load_parts(model), instances, chosen, spp, seed, denoise)
    else:
        from iprt.truth.panorama import load_world, render_reference

        world = load_world(opened.frame(), instances)
        result = render_reference(world, chosen, spp=spp, seed=seed, clean=denoise)
        color = result.color
        layers = {
            name: getattr(result, name) for name in ("ratio", "background", "objects", "coverage")
        }
    write_exr(
        output,
        color,
        aovs=layers,
        metadata={"scene": opened.name, "spp": str(spp), "seed": str(seed)},
    )
    with reporting(f"{output} has been written nevertheless"):
        print(output)
    return 0


def _with_model(
    parts: Mapping[str, Any],
    instances: tuple[Instance, ...],
    view: View,
    spp: int,
    seed: int,
    clean: bool,
) -> Layers:
    from iprt.truth.lights import instance_lights
    from iprt.truth.model import load_scene, render_color, render_mask
    from iprt.truth.shapes import instance_shapes

    shapes = instance_shapes(instances)
    both = load_scene({**parts, **shapes, **instance_lights(instances)})
    color = render_color(both, view, spp=spp, seed=seed, clean=clean)
    background = render_color(load_scene(parts), view, spp=spp, seed=seed, clean=clean)
    coverage = render_mask(parts, shapes, view, seed=seed)
    return color, {"background": background, "coverage": coverage}
