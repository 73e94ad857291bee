"""Found glossy surfaces, written as tables of `scene.toml`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from iprt.errors import SceneError
from iprt.files.atomic import replacing
from iprt.footage.real_material import RealMaterial
from iprt.scene.edit import changing, inline, table_text
from iprt.scene.manifest import MANIFEST_NAME, manifest_text, parse_manifest


def declaration(material: RealMaterial) -> str:
    """Return the `[[real_materials]]` table of a coat on a plane, with a comment of evidence."""
    plane, evidence, coat = material.plane, material.evidence, material.material
    assert plane is not None
    table = table_text(
        "real_materials",
        name=material.name,
        kind=coat.kind,
        alpha=coat.alpha,
        ior=coat.ior,
        plane=inline(vars(plane)),
    )
    return (f"# {evidence.line()}\n" if evidence is not None else "") + table


def declare(root: Path, materials: Iterable[RealMaterial]) -> None:
    """Append declarations to the `scene.toml` of a folder, and keep the rest of the file.

    Raises
    ------
    SceneError
        The file cannot be extended, or is read-only; nothing has been written.
    FormatError
        The file cannot be written.
    """
    path = root / MANIFEST_NAME
    with changing(root):
        # TOML allows [[real_materials]] after other tables.
        tables = [declaration(material) for material in materials]
        text = "\n".join([manifest_text(path).rstrip("\r\n") + "\n", *tables])
        try:
            parse_manifest(text, str(path))
        except SceneError as error:
            raise SceneError(
                f"cannot be extended: {error}", several_lines=error.several_lines
            ) from error
        with replacing(path) as temporary:
            temporary.write_bytes(text.encode("utf-8"))
