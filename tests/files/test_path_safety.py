"""Files of a scene and of its meshes lie in its folder; links out of it need a permission."""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import iprt
from iprt import cli
from iprt.errors import FormatError, IprtError
from iprt.files.safe_reading import stays_inside
from iprt.geometry.meshes import load_mesh
from iprt.scene.scene import Scene
from tests.scene.files import CUBE, MANIFEST, OBJECT, VIEW, snapshot, write_channels, write_scene
from tests.scene.nasty_meshes import DATA, gltf

TEXTURED = OBJECT + 'material = { kind = "diffuse", albedo = [1, 1, 1], texture = "t.png" }\n'
MASKED = '[[real_materials]]\nname = "floor"\nkind = "plastic"\nmask = "t.png"\n'
TRUTH = VIEW + 'truth = "truth/ahead.exr"\n'


@pytest.fixture
def shared(tmp_path: Path) -> Path:
    """A folder beside the scene's, to which its files may be links."""
    folder = tmp_path / "shared"
    folder.mkdir()
    return folder


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    """A scene with a file of every kind."""
    folder = write_scene(tmp_path / "scene", MANIFEST + TEXTURED + MASKED + TRUTH)
    Image.new("RGB", (8, 4), (255, 0, 0)).save(folder / "t.png")
    (folder / "truth").mkdir()
    write_channels(
        folder / "truth" / "ahead.exr", **dict.fromkeys("RGB", np.full((24, 32), 0.5, np.float32))
    )
    (folder / "m.mtl").write_text("newmtl a\nmap_Kd t.png\n")
    (folder / "cube.obj").write_text("mtllib m.mtl\nusemtl a\n" + CUBE)
    return folder


def link_out(file: Path, shared: Path) -> None:
    """Move a file or folder away and leave a link to it."""
    file.rename(shared / file.name)
    file.symlink_to(shared / file.name)


def read_everything(scene: Scene) -> None:
    scene.frame()
    assert scene.instances
    assert scene.real_materials


FILES = ["color.exr", "depth.exr", "cube.obj", "m.mtl", "t.png", "truth", "truth/ahead.exr"]


@pytest.mark.parametrize("name", [*FILES, "scene.toml"])
def test_links_out_need_a_permission(name: str, whole: Path, shared: Path) -> None:
    read_everything(Scene.open(whole))
    link_out(whole / name, shared)
    with pytest.raises(IprtError) as error:
        read_everything(Scene.open(whole))
    first = str(error.value).split("\n  ")[-1]
    assert f"is a link to {shared}" in first
    assert "give --allow-outside" in first
    read_everything(Scene.open(whole, allow_outside=True))


def test_the_folder_itself_may_be_a_link_and_so_may_files_within(
    whole: Path, tmp_path: Path
) -> None:
    (whole / "color.exr").rename(whole / "real.exr")
    (whole / "color.exr").symlink_to("real.exr")
    (tmp_path / "link").symlink_to(whole)
    read_everything(Scene.open(tmp_path / "link"))


def test_a_way_up_behind_a_link_leads_out(whole: Path, shared: Path, tmp_path: Path) -> None:
    """`a/../color.exr` looks like it stays, but where the link `a` leads, `..` is elsewhere."""
    (shared / "below").mkdir()
    (whole / "color.exr").rename(shared / "color.exr")
    (whole / "a").symlink_to(shared / "below")
    text = (whole / "scene.toml").read_text().replace('"color.exr"', '"a/../color.exr"')
    (whole / "scene.toml").write_text(text)
    with pytest.raises(IprtError, match="is a link to"):
        Scene.open(whole)
    Scene.open(whole, allow_outside=True)


def test_every_frame_of_a_video_is_looked_at(whole: Path, shared: Path) -> None:
    text = (whole / "scene.toml").read_text()
    text = text.replace('"color.exr"', '"c.%d.exr"\nframes = [0, 2]')
    (whole / "scene.toml").write_text(text)
    for number in range(3):
        (whole / f"c.{number}.exr").write_bytes((whole / "color.exr").read_bytes())
    Scene.open(whole)
    link_out(whole / "c.1.exr", shared)
    with pytest.raises(IprtError, match=r"c\.1\.exr: is a link"):
        Scene.open(whole)


def test_a_permission_is_none_for_paths_that_are_written_so(whole: Path) -> None:
    """Scenes stay such that they can be moved: paths are relative, with links at most."""
    text = (whole / "scene.toml").read_text()
    for path in ("/etc/passwd", "../color.exr", "a/../../color.exr", "C:/color.exr", r"..\c.exr"):
        (whole / "scene.toml").write_text(text.replace('"color.exr"', f"'{path}'"))
        with pytest.raises(IprtError, match="leaves the scene's folder"):
            Scene.open(whole, allow_outside=True)


@pytest.mark.parametrize(
    ("path", "inside"),
    [
        ("a", True),
        ("a/../b", True),
        ("./a", True),
        ("a/../../b", False),
        ("..", False),
        ("/a", False),
        ("\\a", False),
        ("a\\..\\..\\b", False),
        ("c:a", False),
        ("\\\\server\\share", False),
        ("~/a", True),
        ("...", True),
    ],
)
def test_paths_that_stay(path: str, inside: bool) -> None:
    assert stays_inside(path) == inside


def test_buffers_of_gltf_files(tmp_path: Path, shared: Path) -> None:
    (shared / "b.bin").write_bytes(DATA)
    own = tmp_path / "own"
    own.mkdir()
    (own / "b.bin").symlink_to(shared / "b.bin")
    (own / "m.gltf").write_text(gltf({"buffers.0.uri": "b.bin"}))
    with pytest.raises(FormatError, match="is a link to"):
        load_mesh(own / "m.gltf")
    assert len(load_mesh(own / "m.gltf", within=tmp_path).triangles) == 1


def test_a_mesh_reads_only_what_it_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the parser finds to be a name, nothing else is opened."""
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    (tmp_path / "evil.mtl").write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0 1 0\n")
    (tmp_path / "m.obj").write_text("# mtllib evil.mtl\nmtllib m.mtl\nusemtl a\n" + CUBE)
    opened: list[str] = []
    original = Path.open

    def watched(self: Path, *arguments: object, **named: object) -> object:
        if self.parent == tmp_path:  # the parser's own files apart
            opened.append(self.name)
        return original(self, *arguments, **named)  # type: ignore[call-overload]

    monkeypatch.setattr(Path, "open", watched)
    (material,) = load_mesh(tmp_path / "m.obj").materials
    assert material.albedo == (0.0, 1.0, 0.0)
    assert set(opened) == {"m.obj", "m.mtl"}
    (tmp_path / "m.obj").write_text("o mtllib evil.mtl\nusemtl a\n" + CUBE)
    opened.clear()
    (material,) = load_mesh(tmp_path / "m.obj").materials
    assert material.albedo != (1.0, 0.0, 0.0)
    assert set(opened) == {"m.obj"}


def test_nothing_is_written_through_a_link(
    whole: Path, shared: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    (whole / "meshes").symlink_to(shared)
    (tmp_path / "new.obj").write_text(CUBE)
    before = snapshot(tmp_path)
    words = ["scene", "add", whole, tmp_path / "new.obj", "--look", "0", "-40"]
    assert "meshes/new.obj: is a link to" in fails(*words)
    assert snapshot(tmp_path) == before
    assert cli.main([str(word) for word in words] + ["--allow-outside"]) == 0
    assert (shared / "new.obj").exists()


def test_every_verb_that_reads_a_scene_takes_the_permission(
    whole: Path, shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    link_out(whole / "color.exr", shared)
    for words in (["scene", "info", "--json"], ["scene", "check"]):
        assert cli.main([*words, str(whole)]) == 2
        assert "is a link to" in capsys.readouterr().err
        assert cli.main([*words, str(whole), "--allow-outside"]) == 0
        capsys.readouterr()


@pytest.mark.thorough
def test_no_module_can_run_what_a_file_holds() -> None:
    """No pickles, no `eval`, no `np.load` that may read pickles."""
    banned = {"pickle", "cPickle", "marshal", "shelve", "dill", "joblib", "yaml"}
    calls = {"eval", "exec", "load_module", "compile", "np.load", "numpy.load"}
    for file in Path(iprt.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names: set[str] = set()
            if isinstance(node, ast.Import):
                names = {alias.name.partition(".")[0] for alias in node.names} & banned
            elif isinstance(node, ast.ImportFrom):
                names = {(node.module or "").partition(".")[0]} & banned
            elif isinstance(node, ast.Call):
                safe = any(ast.unparse(word) == "allow_pickle=False" for word in node.keywords)
                names = set() if safe else {ast.unparse(node.func)} & calls
            assert not names, f"{file}:{node.lineno}: {names}"  # type: ignore[attr-defined]
