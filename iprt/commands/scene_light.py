"""`iprt scene light`: addition of a light to a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import tyro

from iprt.commands.flag_types import Angles, Color, Direction, Sides
from iprt.commands.standard_streams import reporting


def light(
    scene: tyro.conf.Positional[Path],
    kind: tyro.conf.Positional[Literal["point", "spot", "rectangle", "sun"]],
    /,
    *,
    look: Direction,
    power: float | None = None,
    unit: Literal["relative", "candela", "lumen", "watt", "lux"] | None = None,
    color: Color = None,
    above: float = 1.0,
    turn: float = 0.0,
    radius: float | None = None,
    cone: Angles = None,
    size: Sides = None,
    diameter: float | None = None,
    profile: Path | None = None,
    name: str | None = None,
    json: bool = False,
    allow_outside: bool = False,
) -> int:
    """Add a light above the surface seen in a direction, or a sun in that direction.

    It shines down. The light itself is not seen; for a lamp that is, add an object with --material
    lamp. In scene.toml and in the viewers it can be moved like an object.

    Parameters
    ----------
    scene
        Scene folder.
    kind
        A point (or sphere, with --radius), a spot, a rectangle that shines to one side, or a sun.
    look
        Direction in which the surface is seen: degrees to the right, and degrees up. The light is
        above the surface. A sun shines from this direction.
    power
        Brightness, in the unit. Needed unless a profile gives it.
    unit
        candela (along its axis), lumen, watt (179 lumen), or lux of a sun. Default: relative, which
        is the intensity along the axis in units of the panorama's radiance times square metres. The
        others depend on the scene's nits: the luminance of a radiance of 1.
    color
        Linear red, green and blue, which multiply the brightness. Default: white.
    above
        Height above the surface in metres.
    turn
        Rotation about the vertical in degrees, counter-clockwise seen from above.
    radius
        Radius of a point or spot in metres, which makes its shadows soft. Default: 0.
    cone
        Half angles of a spot: full brightness inside of the first, none outside of the second.
        Default: 20 30.
    size
        Width and height of a rectangle in metres. Default: 0.5 0.5.
    diameter
        Angular diameter of a sun in degrees. Default: 0.53.
    profile
        IES file with the distribution of a point's light.
    name
        Name of the light. Default: its kind.
    json
        Print the findings as a JSON object instead of text.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.findings import Findings
    from iprt.scene.new_light import add_light

    given: dict[str, Any] = {
        "power": power,
        "unit": unit,
        "color": color,
        "radius": radius,
        "cone_deg": cone,
        "size": size,
        "diameter_deg": diameter,
    }
    lists = {
        key: list(value) if isinstance(value, tuple) else value for key, value in given.items()
    }
    added = add_light(
        scene,
        {"kind": kind} | {key: value for key, value in lists.items() if value is not None},
        *look,
        above_m=above,
        turn_deg=turn,
        profile=profile,
        name=name,
        allow_outside=allow_outside,
    )
    findings = Findings(name=added.name)
    findings.warn(f"{added.name}: {phrase}" for phrase in added.warnings)
    x, y, z = (float(value) for value in added.position)
    findings.say(f"{added.name}: a {kind} at ({x:.2f}, {y:.2f}, {z:.2f})", position=[x, y, z])
    with reporting(f"{added.name} has been added to {scene} nevertheless"):
        findings.print(as_json=json)
    return 0
