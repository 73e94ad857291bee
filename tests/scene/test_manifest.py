"""scene.toml: every fault is one line that names its key."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iprt.errors import SceneError
from iprt.scene.manifest import parse_manifest
from tests.scene.files import IDENTITY, MANIFEST, OBJECT, VIEW


def problems(text: str) -> list[str]:
    with pytest.raises(SceneError) as error:
        parse_manifest(text, "scene.toml")
    message = str(error.value)
    assert message.startswith("scene.toml: ")
    lines = message.removeprefix("scene.toml: ").split("\n  ")
    if len(lines) == 1:
        return lines
    assert lines[0] == f"{len(lines) - 1} problems"
    return lines[1:]


def with_material(material: str) -> str:
    return MANIFEST + OBJECT + f"material = {material}\n"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("format = 1", "format = 2", ["format: expected 1, got 2"]),
        ("format = 1", "", ["format: required key is missing"]),
        ('name = "box"', 'name = "a/b"', ["name: 'a/b': expected a name without slashes"]),
        ("[video]", "[vidio]", ["video: required key", "vidio: unknown key; did you mean video"]),
        ("depth =", "dept =", ["video.depth: required", "video.dept: unknown key; did you mean"]),
        ('"color.exr"', '"/etc/passwd"', ["video.color: '/etc/passwd' leaves the scene's folder"]),
        ('"color.exr"', '"%s.exr"', ["video.color: '%s.exr': expected at most one %d"]),
        ('"color.exr"', '"%d%d.exr"', ["video.color: '%d%d.exr': expected at most one %d"]),
        ('"color.exr"', "3", ["video.color: expected a valid string, got 3"]),
        ("[video]", "[video]\ndepth_scale = nan", ["video.depth_scale: expected a finite number"]),
        ("[video]", "[video]\nframes = [2, 1]", ["video.frames: the first, 2, is after"]),
        ("[video]", "[video]\nframes = [0, 5]", ["video.frames: color = 'color.exr' is one"]),
        ("[video]", "[video]\nframes = [0]", ["video.frames: expected 2 values, got 1"]),
        ("[video]", "[video]\ndepth_encoding = 'inverse'", ["video.depth_encoding: has no effect"]),
        (
            "[video]",
            "[video]\ndepth_scale = 1\ndepth_range = [1, 2]",
            ["video.depth_range: depth_scale is given too"],
        ),
    ],
)
def test_video_and_top_level(old: str, new: str, expected: list[str]) -> None:
    found = problems(MANIFEST.replace(old, new, 1))
    assert len(found) == len(expected)
    for line, start in zip(found, expected, strict=True):
        assert line.startswith(start)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ("[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,2]", "to_world: the last row must be 0, 0, 0, 1"),
        ("[1, 2]", "to_world: expected 16 values, got 2"),
        (IDENTITY.replace("1", "true", 1), "to_world[0]: expected a valid number, got True"),
    ],
)
def test_transforms(matrix: str, message: str) -> None:
    (found,) = problems(MANIFEST + OBJECT.replace(IDENTITY, matrix))
    assert found.startswith(f"objects.cube.{message}")


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ('{ kind = "glass" }', "material: expected kind = 'diffuse', 'conductor', 'plastic', 'pr"),
        ('"red"', "material: expected kind ="),
        ('{ kind = "diffuse" }', "material.albedo: required key is missing"),
        ('{ kind = "diffuse", albedo = [1, 2, 0] }', "material.albedo[1]: expected less than or"),
        ('{ kind = "diffuse", albedo = [1, 1] }', "material.albedo: expected 3 values, got 2"),
        ('{ kind = "diffuse", albedo = [1, 1, 1], alpha = 0.1 }', "material.alpha: unknown key"),
        (
            '{ kind = "principled", albedo = [1, 1, 1], clearcoat = 1.5 }',
            "material.clearcoat: expected less than or equal to 1, got 1.5",
        ),
        ('{ kind = "principled", albedo = [1, 1, 1], sheen = 0.5 }', "material.sheen: expected"),
        (
            '{ kind = "principled", albedo = [1, 1, 1], tint = [1, 1, 2] }',
            "material.tint",
        ),
        (
            '{ kind = "plastic", albedo = [1, 1, 1], clearcoat = 1 }',
            "material.clearcoat: unknown key",
        ),
        (
            '{ kind = "plastic", albedo = [1, 1, 1], alpha = -0.1 }',
            "material.alpha: expected greater than or equal to 0, got -0.1",
        ),
        (
            '{ kind = "diffuse", albedo = [1, 1, 1], texture = "../t.png" }',
            "material.texture: '../t.png' leaves the scene's folder",
        ),
    ],
)
def test_materials(material: str, message: str) -> None:
    (found,) = problems(with_material(material))
    assert found.startswith(f"objects.cube.{message}")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[32, 24]", "[32, 99999]", "views.ahead.size[1]: expected less than or equal to 16384"),
        ("[32, 24]", "[32]", "views.ahead.size: expected 2 values, got 1"),
        ("[32, 24]", "[32, 24]\nfov_y_deg = 180", "views.ahead.fov_y_deg: expected less than 180"),
        (
            "[32, 24]",
            '[32, 24]\nobjects = ["cub"]',
            "views: ahead: no object is named 'cub'; the scene has cube",
        ),
        ("[32, 24]", "[32, 24]\ncuts = [[0, 0, 33, 4]]", "views.ahead.cuts: [0, 0, 33, 4] is em"),
        ("[32, 24]", "[32, 24]\ncuts = [[5, 0, 5, 4]]", "views.ahead.cuts: [5, 0, 5, 4] is empty"),
        ("[32, 24]", '[32, 24]\ntruth = "/t.exr"', "views.ahead.truth: '/t.exr' leaves the scene"),
    ],
)
def test_views(old: str, new: str, message: str) -> None:
    (found,) = problems(MANIFEST + OBJECT + VIEW.replace(old, new))
    assert found.startswith(message)


def test_names_must_differ() -> None:
    found = problems(MANIFEST + OBJECT + OBJECT + VIEW + VIEW)
    assert found == [
        "objects: 2 of them are named 'cube'; names must differ",
        "views: 2 of them are named 'ahead'; names must differ",
    ]


def test_all_problems_come_at_once() -> None:
    text = (
        MANIFEST.replace("format = 1", "format = 9").replace('"color.exr"', '"/c.exr"')
        + OBJECT.replace(IDENTITY, "[1]")
        + VIEW.replace("[32, 24]", "[32, 24]\ncuts = [[9, 9, 1, 1]]\nfow = 3")
    )
    keys = {line.split(":")[0] for line in problems(text)}
    assert keys == {
        "format",
        "video.color",
        "objects.cube.to_world",
        "views.ahead.cuts",
        "views.ahead.fow",
    }


def test_a_percent_sign_in_a_mesh_is_no_pattern() -> None:
    text = MANIFEST + OBJECT.replace("cube.obj", "50%.obj")
    assert parse_manifest(text, "scene.toml").objects[0].mesh == "50%.obj"


LEAVES: st.SearchStrategy[Any] = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just([])
)


@settings(max_examples=150)
@given(data=st.data())
def test_any_wrong_value_is_an_error_that_names_its_key(data: st.DataObject) -> None:
    """Replace one value anywhere: the manifest stays right, or an error names the key."""
    material = '{ kind = "plastic", albedo = [0.1, 0.2, 0.3], alpha = 0.1, ior = 1.5 }'
    text = with_material(material) + VIEW + "cuts = [[0, 0, 4, 4]]\n"
    tree = tomllib.loads(text)
    node: Any = tree
    path: list[Any] = []
    while isinstance(node, (dict, list)) and node:
        key = data.draw(
            st.sampled_from(sorted(node) if isinstance(node, dict) else range(len(node)))
        )
        path.append(key)
        parent, node = node, node[key]
    value = data.draw(LEAVES)
    parent[path[-1]] = value
    dumped = _toml(tree)
    try:
        parse_manifest(dumped, "scene.toml")
    except SceneError as error:
        words = [str(step) for step in path if isinstance(step, str)]
        assert words[0] in str(error)  # noqa: PT017
        assert "Traceback" not in str(error)  # noqa: PT017


def _toml(value: Any, top: bool = True) -> str:
    """A table as TOML, nested ones inline; None becomes a missing key."""
    if top:
        return "".join(f"{k} = {_toml(v, False)}\n" for k, v in value.items() if v is not None)
    if isinstance(value, dict):
        pairs = (f"{k} = {_toml(v, False)}" for k, v in value.items() if v is not None)
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(v, False) for v in value if v is not None) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else repr(value).replace("nan", "nan")
    if isinstance(value, str):
        return (
            '"' + "".join(f"\\U{ord(c):08x}" for c in value if not 0xD800 <= ord(c) < 0xE000) + '"'
        )
    return repr(value)
