"""`iprt scene sun`: detection of a sun that a scene's panorama does not show."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

if TYPE_CHECKING:
    from iprt.footage.sun import Sun


def sun(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    json: bool = False,
    allow_outside: bool = False,
) -> int:
    """Find the sun that lights patches of a scene, and print it as [video.sun] to add.

    Its direction follows from the pattern of the patches, its irradiance from their borders. It is
    used without being declared, unless the scene's [video] has sun = "none".

    Parameters
    ----------
    scene
        Scene folder.
    json
        Print a JSON object instead of TOML.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.scene.scene import Scene

    opened = Scene.open(scene, allow_outside=allow_outside)
    light = opened.found_light
    found = light.sun
    if json:
        record = None if found is None else _record(found)
        print(json_format.dumps({"sun": record, "doubt": light.doubt}, indent=2))
    elif found is None:
        print(f"# {opened.name}: no patch is surely lit by a sun: {light.doubt}")
    else:
        print(f"# correlation of its light with the picture: {found.correlation:.2f}")
        print("[video.sun]")
        print("\n".join(f"{name} = {value}" for name, value in _record(found).items()))
    return 0


def _record(found: Sun) -> dict[str, Any]:
    """Return the keys of `[video.sun]`."""
    from iprt.scene.light_edits import sun_table

    direction = found.direction.tolist()
    return sun_table(direction, found.irradiance, found.angle_deg).model_dump()
