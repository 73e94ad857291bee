"""`iprt scene gloss`: the glossy surfaces that are found in a scene's picture."""

from __future__ import annotations

from pathlib import Path

import tyro

from iprt.commands.standard_streams import reporting
from iprt.files.wording import counted


def gloss(
    scene: tyro.conf.Positional[Path], /, *, write: bool = False, allow_outside: bool = False
) -> int:
    """Show which surfaces reflect though nobody declared it, as [[real_materials]] to edit.

    With the strength of the evidence. Where `[video]` says gloss = "auto", the default, they are
    rendered so anyway.

    Parameters
    ----------
    scene
        Scene folder.
    write
        Append them to scene.toml. What is declared is not looked for again.
    allow_outside
        Follow links in the scene's folder to files outside of it.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.scene.declaring import declaration, declare
    from iprt.scene.manifest import MANIFEST_NAME
    from iprt.scene.scene import Scene

    opened = Scene.open(scene, allow_outside=allow_outside)
    found = opened.found_materials
    if not found:
        print(f"# {opened.name}: no surface shows a reflection that is surely one")
        return 0
    if write:
        declare(opened.root, found)
    with reporting(f"{scene} has been extended all the same" if write else "nothing was written"):
        print("\n".join(declaration(material) for material in found))
        if write:
            print(f"# {counted(len(found), 'table')} appended to {opened.root / MANIFEST_NAME}")
    return 0
