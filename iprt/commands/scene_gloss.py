"""`iprt scene gloss`: detection of glossy surfaces in a scene's picture."""

from __future__ import annotations

import json as json_format
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from iprt.commands.standard_streams import reporting
from iprt.files.message_text import counted

if TYPE_CHECKING:
    from iprt.footage.real_material import RealMaterial


def gloss(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    write: bool = False,
    json: bool = False,
    allow_outside: bool = False,
) -> int:
    """Find glossy surfaces in a scene's picture and print them as [[real_materials]] to edit.

    Each has the strength of its evidence beside it. By default (gloss = "auto" in the scene's
    [video]) these surfaces are rendered as glossy without being declared.

    Parameters
    ----------
    scene
        Scene folder.
    write
        Append them to scene.toml. Surfaces that are declared are not searched for again.
    json
        Print a JSON object instead of TOML.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.scene.manifest import MANIFEST_NAME
    from iprt.scene.manifest_writing import declaration, declare
    from iprt.scene.scene import Scene

    opened = Scene.open(scene, allow_outside=allow_outside)
    search = opened.searched_gloss
    found = search.found
    if write and found:
        declare(opened.root, found)
    with reporting(f"{scene} has been extended nevertheless" if write else "nothing was written"):
        if json:
            record = {
                "found": [_record(one) for one in found],
                "doubts": [asdict(one) for one in search.doubts],
            }
            print(json_format.dumps(record, indent=2))
        elif not found:
            print(f"# {opened.name}: no surface shows a reflection that is surely one")
        else:
            print("\n".join(declaration(material) for material in found))
            if write:
                print(f"# {counted(len(found), 'table')} appended to {opened.root / MANIFEST_NAME}")
        if not json:
            for doubt in search.doubts:
                print(f"# diffuse: {doubt.line()}")
    return 0


def _record(material: RealMaterial) -> dict[str, Any]:
    """Return a detected surface as plain data."""
    plane, evidence, coat = material.plane, material.evidence, material.material
    return {
        "name": material.name,
        "kind": coat.kind,
        "alpha": coat.alpha,
        "ior": coat.ior,
        "plane": None if plane is None else asdict(plane),
        "evidence": None if evidence is None else asdict(evidence),
    }
