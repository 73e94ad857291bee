"""USD files that are damaged or refer to files elsewhere: one line, and nothing is read."""

from __future__ import annotations

import importlib.util
import os
import sys
import zipfile
from pathlib import Path

import pytest
from PIL import Image

from iprt.errors import FormatError
from iprt.geometry import usd_file
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.meshes import load_mesh
from tests.geometry.usd_files import (
    READER,
    in_this_process,  # noqa: F401
    square,
    surface,
    texture,
    usda,
)

pytest.importorskip("pxr", reason="needs the extra `usd`")
from pxr import Sdf

here = pytest.mark.usefixtures("in_this_process")
TEXTURED = "color3f inputs:diffuseColor.connect = </thing/look/t.outputs:rgb>"


def refused(path: Path, *words: str) -> str:
    with pytest.raises(FormatError) as caught:
        load_mesh(path)
    said = str(caught.value)
    assert said.startswith(str(path.parent))
    assert "\n" not in said
    assert all(word in said for word in words), said
    return said


def test_a_file_is_read_by_its_own_process(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    usda(tmp_path / "part.usda", square())
    body = 'def "a" (references = @part.usda@)\n{\n}'
    file = MeshFile(usda(tmp_path / "a.usda", body))
    assert list(map(str, file.references)) == ["part.usda"]
    assert len(load_mesh(tmp_path / "a.usda").triangles) == 2
    refused(usda(tmp_path / "b.usda", "def Mesh {"), "cut off or damaged USD file (b.usda:9:1: ")
    assert capfd.readouterr() == ("", "")


def test_a_process_that_dies_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        usd_file, "READING", [sys.executable, "-c", "import os; os.kill(os.getpid(), 9)"]
    )
    refused(usda(tmp_path / "a.usda", square()), "memory or time")


@here
def test_damage(tmp_path: Path) -> None:
    layer = Sdf.Layer.CreateNew(str(tmp_path / "whole.usdc"))
    layer.ImportFromString(usda(tmp_path / "a.usda", square()).read_text())
    layer.Save()
    data = (tmp_path / "whole.usdc").read_bytes()
    assert len(load_mesh(tmp_path / "whole.usdc").triangles) == 2
    for name, content in (
        ("cut.usdc", data[: len(data) // 2]),
        ("empty.usd", b""),
        ("text.usdc", b"#usda 1.0\n"),
        ("noise.usdz", b"PK\x03\x04" + bytes(50)),
    ):
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, "cut off or damaged USD file")
    refused(tmp_path / "missing.usda", "no such")
    refused(usda(tmp_path / "none.usda", ""), "holds no triangles")
    bad = square().replace("[0, 1, 2, 3]", "[0, 1, 2, 9]")
    refused(usda(tmp_path / "bad.usda", bad), "/thing/square", "does not exist")
    bad = square().replace("Counts = [4]", "Counts = [5]")
    refused(usda(tmp_path / "bad.usda", bad), "/thing/square", "do not match")


@here
@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("../part.usda", "outside its folder"),
        ("/etc/part.usda", "outside its folder"),
        ("sub/../../part.usda", "outside its folder"),
        ("https://example.org/part.usda", "on the net"),
        ("part.usda:SDF_FORMAT_ARGS:a=b.usda", "no plain file name"),
        ("part.obj", "only .usd, .usda, .usdc are read there"),
        ("link.usda", "is a link"),
        ("nowhere.usda", "missing"),
    ],
)
@pytest.mark.parametrize("kind", ["references", "payload", "subLayers", "variant"])
def test_layers_stay_in_the_folder(tmp_path: Path, written: str, said: str, kind: str) -> None:
    usda(tmp_path / "part.usda", square())
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "link.usda").symlink_to(tmp_path / "part.usda")
    body = f'def "a" ({kind} = @{written}@)\n{{\n}}'
    if kind == "variant":
        body = 'def "a" (variantSets = "v")\n{\nvariantSet "v" = {\n"x" (references = '
        body += f"@{written}@) {{\n}}\n}}\n}}"
    path = usda(folder / "a.usda", "" if kind == "subLayers" else body)
    if kind == "subLayers":
        head = path.read_text()
        path.write_text(
            head.replace("#usda 1.0\n(", f"#usda 1.0\n(\n    subLayers = [@{written}@]")
        )
    refused(path, said)


@here
def test_nested_layers_refer_from_their_own_folder(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.png")
    look = surface(TEXTURED, READER + texture("t", "../t.png"))
    usda(tmp_path / "sub" / "part.usda", look)
    body = 'def "a" (references = @sub/part.usda@)\n{\n}'
    path = usda(tmp_path / "a.usda", body)
    file = MeshFile(path)
    assert sorted(map(str, file.references.values())) == ["sub/part.usda", "t.png"]
    assert load_mesh(path).materials[0].texture is not None
    (tmp_path / "sub" / "part.usda").write_text(
        (tmp_path / "sub" / "part.usda").read_text().replace("../t.png", "../../t.png")
    )
    refused(path, "outside its folder")


@here
def test_value_clips_are_left_out(tmp_path: Path) -> None:
    outside = usda(tmp_path / "part.usda", square())
    (tmp_path / "folder").mkdir()
    clips = f"clips = {{dictionary default = {{asset[] assetPaths = [@{outside}@]\n"
    clips += 'string primPath = "/thing"\ndouble2[] active = [(0, 0)]\ndouble2[] times = [(0, 0)]\n'
    body = f'def "a" ({clips}}}}})\n{{\n{square()}\n}}'
    mesh = load_mesh(usda(tmp_path / "folder" / "a.usda", body))
    assert mesh.dropped == ("value clips",)


@here
def test_textures_stay_in_the_folder(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    (tmp_path / "folder").mkdir()
    for file, said in (("../t.png", "outside"), ("t.png", "missing"), (os.devnull, "outside")):
        body = surface(TEXTURED, READER + texture("t", file))
        refused(usda(tmp_path / "folder" / "a.usda", body), said)


def packed(path: Path, *files: Path, method: int = zipfile.ZIP_STORED, top: str = "") -> Path:
    with zipfile.ZipFile(path, "w", method) as package:
        for file in files:
            package.write(file, top + file.name)
    return path


@here
def test_packages(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (0, 255, 0)).save(tmp_path / "t.png")
    layer = usda(tmp_path / "a.usda", surface(TEXTURED, READER + texture("t", "t.png")))
    whole = packed(tmp_path / "a.usdz", layer, tmp_path / "t.png")
    alone = tmp_path / "alone"
    alone.mkdir()
    whole.rename(alone / "a.usdz")
    file = MeshFile(alone / "a.usdz")
    assert file.references == {}
    material = load_mesh(alone / "a.usdz").materials[0]
    assert material.texture is not None
    assert material.texture[0, 0].tolist() == [0, 1, 0]
    refused(packed(alone / "b.usdz", layer), "t.png", "not in it")
    refused(packed(alone / "c.usdz", tmp_path / "t.png", layer), "no USD layer")
    refused(packed(alone / "d.usdz", layer, method=zipfile.ZIP_DEFLATED), "compressed")
    refused(packed(alone / "e.usdz", layer, top="../"), "no plain name")


def test_without_usd_one_line_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    said = refused(usda(tmp_path / "a.usda", square()))
    assert said.endswith("pip install 'iprt[usd]'")
