"""Manifests and settings made to hurt whoever reads them, each with the error that it must give."""

from __future__ import annotations

import os
from pathlib import Path

from tests.scene.files import MANIFEST, OBJECT, VIEW
from tests.scene.nasty import nasty, nasty_script

WHOLE = MANIFEST + OBJECT + VIEW
LONG = "9" * 5000
HEX = "0x" + "f" * 5000
KEYS = "".join(f"a{i} = 1\n" for i in range(50_000))

for _name, _old, _new, _message in (
    ("10^12 frames", "depth =", "frames = [0, 1_000_000_000_000]\ndepth =", "video.frames[1]: "),
    (
        "10^6 frames without files",
        '"color.exr"',
        '"c.%d.exr"\nframes = [0, 999_999]',
        "at least 9999 more",
    ),
    ("format of 5000 digits", "format = 1", f"format = {LONG}", "more than 64 bits"),
    ("format of 5000 digits in hex", "format = 1", f"format = {HEX}", "format: a number of more"),
    ("matrix of 5000 digits", "[1, 0", f"[{HEX}, 0", "to_world: a number of more than 64"),
    ("a matrix beyond floats", "[1, 0", "[1e999, 0", "to_world[0]: expected a finite"),
    ("a view through a pinhole", "size =", "fov_y_deg = 1e-300\nsize =", "views.ahead.fov_y_deg: "),
    ("metres of 10^300", "depth =", "depth_scale = 1e300\ndepth =", "video.depth_scale: "),
    (
        "500 values that are no depth",
        "depth =",
        f"depth_sky = {list(range(500))}\ndepth =",
        "video.depth_sky: expected 16 values, got 500",
    ),
    ("a cut beyond 64 bits", "size =", f"cuts = [[0, 0, {HEX}, 1]]\nsize =", "more than 64 bits"),
    ("a path with a zero byte", '"cube.obj"', '"a\\u0000b"', "objects.cube.mesh: 'a\\x00b': exp"),
    ("a path that ends the line", '"cube.obj"', '"a\\nb"', "objects.cube.mesh: 'a\\nb': expected"),
    ("a path of 5000 letters", '"cube.obj"', f'"{"a" * 5000}"', "there is no file aaaa"),
    ("a path by URL", '"cube.obj"', '"https://a.b/c.obj"', "there is no file https://a.b/c.obj"),
    ("a path in Windows", '"cube.obj"', "'\\\\server\\share\\c.obj'", "leaves the scene's folder"),
    (
        "a name that colors the terminal",
        '"cube"',
        '"\\u001b[31mcube"',
        "'\\x1b[31mcube': expected",
    ),
    ("a key that ends the line", "[video]", '"a\\nb" = 1\n[video]', "a\\nb: unknown key"),
    ("a view of 16384 x 16385", "[32, 24]", "[16384, 16385]", "views.ahead.size[1]: "),
):
    assert WHOLE.count(_old) == 1, _old
    nasty("manifest", "scene.toml", _name, WHOLE.replace(_old, _new), _message)

nasty("manifest", "scene.toml", "50000 keys", KEYS, "more than 100 problems")
nasty("manifest", "scene.toml", "5000 objects", MANIFEST + OBJECT * 5000, "objects: 5000 of th")
nasty(
    "manifest",
    "scene.toml",
    "a view of 10000 unknown objects",
    MANIFEST + "[[views]]\nname = 'a'\nobjects = [" + ("1, 'b'," * 500 + "\n") * 10 + "]\n",
    "more than 100 problems",
)
for _reader, _file in (("manifest", "scene.toml"), ("settings", "my.toml")):
    for _name, _data, _message in (
        ("brackets", "a = " + "[\n" * 10**5, "nested too deep"),
        ("tables", "[" + "a." * 1000 + "a]\n", "nested too deep"),
        ("a line", "a." * 10**5 + "a = 1\n", "line 1 has more than 10000 letters"),
        ("size", "#" * 2**21, "too large"),
        ("zeros", bytes(10**5), "line 1 has more than"),
        ("half a letter", b"a = 1\n\xc3", "line 2 is not UTF-8"),
        ("a number", f"seed = {LONG}\n", "more than 64 bits"),
        ("a number in hex", f"seed = {HEX}\n", "seed: a number of more than 64 bits"),
    ):
        nasty(_reader, _file, f"{_reader} of too much: {_name}", _data, _message)  # type: ignore[arg-type]
for _name, _data, _message in (
    ("settings of NaN", "[trace]\nrays = nan\n", "trace.rays = nan: expected"),
    ("settings with a key that ends the line", '"a\\nb" = 1\n', "a\\nb = 1: there is no setting"),
    ("settings with a long text", f'seed = "{"x" * 9000}"\n', "..."),
):
    nasty("settings", "my.toml", _name, _data, _message)


@nasty_script("manifest", "scene.toml", "not a file")
def a_manifest_that_waits_for_a_writer(path: Path) -> None:
    os.mkfifo(path)


@nasty_script("settings", "my.toml", "not a file")
def settings_that_wait_for_a_writer(path: Path) -> None:
    os.mkfifo(path)


@nasty_script("settings", "my.toml", "my.toml: ")
def settings_in_a_folder(path: Path) -> None:
    path.mkdir()


@nasty_script("color", "c.png", "not a file")
def a_picture_that_waits_for_a_writer(path: Path) -> None:
    os.mkfifo(path)
