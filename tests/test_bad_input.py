"""Bad scenes through the command line: one line that names the file or key, and exit code 2."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from iprt import cli
from tests.scene import nasty_meshes, nasty_text  # noqa: F401  (they add to the corpus)
from tests.scene.files import (
    CUBE,
    IDENTITY,
    MANIFEST,
    OBJECT,
    VIEW,
    box_room,
    snapshot,
    write_channels,
    write_png16_grey,
    write_rgb,
)
from tests.scene.nasty import CORPUS

WHOLE = MANIFEST + OBJECT + VIEW
Change = Callable[[Path], object]
NOISE = np.random.default_rng(3).integers(0, 256, 400, np.uint8).tobytes()


def cut(name: str, part: float = 0.5) -> Change:
    """Keep the first `part` of a file."""

    def change(folder: Path) -> None:
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data[: int(len(data) * part)])

    return change


def holds(name: str, data: bytes | str) -> Change:
    content = data.encode() if isinstance(data, str) else data
    return lambda folder: (folder / name).write_bytes(content)


def depth_is(value: float) -> Change:
    return lambda folder: write_channels(folder / "depth.exr", Z=np.full((32, 64), value, "f4"))


def color_is(value: float) -> Change:
    return lambda folder: write_rgb(folder / "color.exr", np.full((32, 64, 3), value, "f4"))


def replaced(old: str, new: str, *more: Change) -> Change:
    """Change the manifest, then whatever else."""

    def change(folder: Path) -> None:
        assert WHOLE.count(old) == 1
        (folder / "scene.toml").write_text(WHOLE.replace(old, new))
        for step in more:
            step(folder)

    return change


def picture(name: str, kind: str) -> Change:
    image = Image.fromarray(np.random.default_rng(1).integers(0, 256, (32, 64, 3), np.uint8))
    return lambda folder: image.save(folder / name, format=kind)


def depth_png(folder: Path) -> None:
    write_png16_grey(folder / "depth.png", np.rint(box_room(64, 32)[0] * 1000).astype(np.uint16))


def square(folder: Path) -> None:
    write_rgb(folder / "color.exr", np.ones((64, 64, 3), np.float32))


def box(suffix: str) -> bytes:
    data: bytes = trimesh.creation.box().export(file_type=suffix)
    return data


def cut_mesh(suffix: str) -> Change:
    data = box(suffix)
    return replaced("cube.obj", f"m.{suffix}", holds(f"m.{suffix}", data[: len(data) * 2 // 3]))


SCALED = 'depth = "depth.png"\ndepth_scale = 0.001'
BAD_SCENES: dict[str, tuple[Change, str]] = {
    "color missing": (lambda f: (f / "color.exr").unlink(), "video.color: there is no file"),
    "depth missing": (lambda f: (f / "depth.exr").unlink(), "video.depth: there is no file"),
    "mesh missing": (lambda f: (f / "cube.obj").unlink(), "objects.cube.mesh: there is no file"),
    "EXR cut off": (cut("color.exr"), "color.exr: cut off or damaged"),
    "EXR empty": (cut("depth.exr", 0.0), "depth.exr: empty"),
    "EXR is text": (holds("color.exr", "hello"), "color.exr: not an EXR, PNG"),
    "depth PNG unscaled": (replaced("depth.exr", "depth.png", depth_png), "video.depth_scale: "),
    "depth in colors": (
        replaced('depth = "depth.exr"', SCALED, picture("depth.png", "PNG")),
        "depth.png: a picture in colors; false colors cannot be read as depth",
    ),
    "sizes differ": (
        lambda f: write_channels(f / "depth.exr", Z=np.ones((64, 128), np.float32)),
        "depth.exr: 128 x 64 pixels, but color has 64 x 32",
    ),
    "not 2:1": (square, "color.exr: 64 x 64 pixels; an equirect panorama is twice as wide"),
    "depth all NaN": (depth_is(np.nan), "depth.exr: no depth"),
    "depth all zero": (depth_is(0.0), "depth.exr: no depth"),
    "depth all negative": (depth_is(-2.0), "depth.exr: no depth"),
    "color all NaN": (color_is(np.nan), "color.exr: color is NaN or infinite"),
    "color all infinite": (color_is(np.inf), "color.exr: color is NaN or infinite"),
    "mesh without faces": (holds("cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), "no triangles"),
    "mesh of NaN": (holds("cube.obj", CUBE.replace(" 1 ", " nan ")), "cube.obj"),
    "mesh of unknown kind": (replaced("cube.obj", "m.fbx", holds("m.fbx", "x")), "m.fbx: not a"),
    "PLY of noise": (replaced("cube.obj", "m.ply", holds("m.ply", NOISE)), "m.ply: cut off"),
    "GLB of noise": (replaced("cube.obj", "m.glb", holds("m.glb", NOISE)), "m.glb: cut off"),
    "PLY cut off": (cut_mesh("ply"), "m.ply: cut off"),
    "GLB cut off": (cut_mesh("glb"), "m.glb: cut off"),
    "texture missing": (
        replaced(
            IDENTITY, f'{IDENTITY}\nmaterial = {{kind="diffuse", albedo=[1,1,1], texture="t.png"}}'
        ),
        "objects.cube.material.texture: there is no file t.png",
    ),
    "texture is text": (
        replaced(
            IDENTITY,
            f'{IDENTITY}\nmaterial = {{kind="diffuse", albedo=[1,1,1], texture="t.png"}}',
            holds("t.png", "hi"),
        ),
        "t.png: not an EXR, PNG",
    ),
}


@pytest.mark.parametrize(("change", "message"), BAD_SCENES.values(), ids=BAD_SCENES)
def test_bad_scenes(change: Change, message: str, scene: Path, fails: Callable[..., str]) -> None:
    change(scene)
    for verb in ("check", "info"):
        line = fails("scene", verb, scene)
        assert message in line
        assert line.count(str(scene)) == 1 or "video." in line, "no path is said twice"


BAD_MANIFESTS: dict[str, tuple[bytes, str]] = {
    "no TOML": (b"format = = 1", "not valid TOML"),
    "not UTF-8": (b'format = 1\nname = "caf\xe9"', "line 2 is not UTF-8"),
    "nested too deep": (b"a = " + b"[\n" * 5000 + b"]" * 5000, "nested too deep"),
    "one table": (WHOLE.replace("[[views]]", "[views]").encode(), "views: expected a list"),
    "type": (WHOLE.replace("[32, 24]", '"big"').encode(), "views.ahead.size: expected a list"),
    "object": (WHOLE.encode() + b'objects = ["cub"]', "no object is named 'cub'; the scene has"),
    "NaN": (WHOLE.replace("[1,", "[nan,").encode(), "objects.cube.to_world[0]: expected a finite"),
    "singular": (WHOLE.replace("[1,", "[0,").encode(), "objects.cube.to_world: the matrix is"),
    "far": (WHOLE.replace("[1, 0, 0, 0", "[1, 0, 0, 1e30").encode(), "holds 1e+30; at most 1e+06"),
}


@pytest.mark.parametrize(("text", "message"), BAD_MANIFESTS.values(), ids=BAD_MANIFESTS)
def test_bad_manifests(text: bytes, message: str, scene: Path, fails: Callable[..., str]) -> None:
    (scene / "scene.toml").write_bytes(text)
    line = fails("scene", "info", scene)
    assert line.startswith(f"iprt: error: {scene}{os.sep}scene.toml: ")
    assert message in line


def test_all_problems_at_once_with_suggestions(
    scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = WHOLE.replace("format = 1", "format = 1\nexposur = 2").replace("size", "sise")
    material = 'material = {kind = "plastic", albedo = [1, 1, 1], alfa = 0.1}'
    text = text.replace(IDENTITY, f"{IDENTITY}\n{material}").replace("[video]", "[video]\nfsp = 3")
    (scene / "scene.toml").write_text(text)
    assert cli.main(["scene", "info", str(scene)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert "5 problems" in lines[0]
    for wanted in (
        "exposur: unknown key; did you mean exposure?",
        "video.fsp: unknown key; did you mean fps?",
        "objects.cube.material.alfa: unknown key; did you mean alpha?",
        "views.ahead.sise: unknown key; did you mean size?",
        "views.ahead.size: required key is missing",
    ):
        assert f"  {wanted}" in lines


def test_a_manifest_with_a_byte_order_mark_and_windows_line_ends_is_read_and_kept(
    scene: Path, tmp_path: Path
) -> None:
    text = WHOLE.replace("\n", "\r\n")
    (scene / "scene.toml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    (tmp_path / "m.obj").write_text(CUBE)
    words = ["scene", "add", str(scene), str(tmp_path / "m.obj"), "--look", "-10", "-40"]
    assert cli.main(words) == 0
    assert (scene / "scene.toml").read_bytes().startswith(text.rstrip().encode())
    assert cli.main(["scene", "check", str(scene)]) == 0


def test_partly_bad_color_is_a_warning(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    color = np.full((32, 64, 3), 0.5, np.float32)
    color[:8] = np.nan
    write_rgb(scene / "color.exr", color)
    assert cli.main(["scene", "check", str(scene)]) == 0
    assert "25.00% of the picture is NaN or infinite" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "message"), [("t.jpg", "ends in .png"), ("room/color.png", "belongs to the scene")]
)
def test_bad_thumbnails(
    name: str, message: str, tmp_path: Path, scene: Path, fails: Callable[..., str]
) -> None:
    picture("color.png", "PNG")(scene)
    replaced("color.exr", "color.png")(scene)
    before = snapshot(tmp_path)
    assert message in fails("scene", "info", scene, "--thumbnail", tmp_path / name)
    assert snapshot(tmp_path) == before


NASTY = {entry.name: entry for entry in CORPUS}


@pytest.mark.parametrize(
    "name",
    [
        "PNG of 16 bits, 10^10 pixels",
        "PLY of 2^31 vertices",
        "texture that ghostscript would run",
        "glTF accessor of 2^40",
        "a name that colors the terminal",
        "manifest of too much: a number in hex",
    ],
)
def test_nasty_files_end_with_one_line(name: str, scene: Path, fails: Callable[..., str]) -> None:
    """A sample of the corpus; `tests/scene/test_nasty.py` reads all of it."""
    entry = NASTY[name]
    key = {"color": "color.exr", "depth": "depth.exr", "mesh": "cube.obj"}.get(entry.reader)
    if key is not None:
        replaced(key, entry.file)(scene)
    entry.write(scene / entry.file)
    assert entry.message in fails("scene", "info", scene)


@pytest.mark.parametrize("name", ["PLY of 2^31 vertices", "glTF buffer of the net"])
def test_nasty_meshes_are_not_added(
    name: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    NASTY[name].write(tmp_path / NASTY[name].file)
    before = snapshot(scene)
    line = fails("scene", "add", scene, tmp_path / NASTY[name].file, "--look", "0", "-40")
    assert NASTY[name].message in line
    assert snapshot(scene) == before


@pytest.mark.parametrize(
    "name", ["settings of too much: brackets", "settings of too much: a number in hex"]
)
def test_nasty_settings_end_with_one_line(
    name: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    NASTY[name].write(tmp_path / "my.toml")
    words = ("render", scene, "-o", tmp_path / "a.png", "--settings", tmp_path / "my.toml")
    assert NASTY[name].message in fails(*words)
