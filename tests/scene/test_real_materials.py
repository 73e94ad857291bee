"""Glossy surfaces that a scene does not declare: looked for once, kept, told and written."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt import cli
from iprt.footage.found_gloss import search
from iprt.footage.frame import Frame
from iprt.footage.real_material import Doubt, Evidence, GlossSearch, Plane, RealMaterial
from iprt.geometry.material import Material
from iprt.scene import real_materials
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, write_scene

FLOOR = RealMaterial(
    "floor",
    Material("plastic", alpha=0.12, ior=1.5),
    plane=Plane((0.0, -1.3, 0.0), (0.0, 1.0, 0.0), 0.01),
    evidence=Evidence(t=12.0, strength=0.8, error=0.07, low=0.1, high=0.14),
)
SHELF = '\n[[real_materials]]\nname = "shelf"\nkind = "plastic"\ncolor = [1.0, 0.0, 0.0]\n'


@pytest.fixture
def looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[frozenset[str]]:
    """A cache of its own, and the names that were taken each time gloss was looked for."""
    calls: list[frozenset[str]] = []

    def find(frame: Frame, taken: frozenset[str], later: Iterable[Frame]) -> GlossSearch:
        assert frame.height >= real_materials.MIN_HEIGHT
        calls.append(taken)
        return GlossSearch((FLOOR,), (Doubt("wall", 90, 0, "no sign of a reflection (t = 1.2)"),))

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(search, "find_gloss", find)
    return calls


def scene_with(folder: Path, text: str = "", video: str = "", height: int = 64) -> Path:
    manifest = MANIFEST.replace("[video]", f"[video]\n{video}") + text
    return write_scene(folder, manifest, width=2 * height)


def test_it_is_looked_for_once(tmp_path: Path, looks: list[frozenset[str]]) -> None:
    folder = scene_with(tmp_path / "a")
    for _ in range(2):
        scene = Scene.open(folder)
        assert scene.real_materials == (FLOOR,)
        frame = scene.frame()
        assert frame.gloss is not None
        assert 0.1 < (frame.gloss == 1).mean() < 0.5
    assert looks == [frozenset()]


def test_it_is_looked_for_again_in_other_pictures(
    tmp_path: Path, looks: list[frozenset[str]]
) -> None:
    _ = Scene.open(scene_with(tmp_path / "a")).real_materials
    _ = Scene.open(scene_with(tmp_path / "a", height=80)).real_materials
    assert len(looks) == 2
    # Views and objects have nothing to do with it; what is declared has.
    path = tmp_path / "a" / "scene.toml"
    path.write_text(path.read_text() + '\n[[views]]\nname = "b"\nsize = [8, 8]\n')
    _ = Scene.open(tmp_path / "a").real_materials
    assert len(looks) == 2
    path.write_text(path.read_text() + SHELF)
    assert [m.name for m in Scene.open(tmp_path / "a").real_materials] == ["floor", "shelf"]
    assert looks[2:] == [frozenset({"shelf"})]


def test_it_is_looked_for_again_below_another_mask(
    tmp_path: Path, looks: list[frozenset[str]]
) -> None:
    masked = SHELF.replace("color = [1.0, 0.0, 0.0]", 'mask = "mask.png"')
    folder = scene_with(tmp_path / "a", masked)
    for rows in (3, 5):
        mask = np.zeros((16, 32, 3), np.uint8)
        mask[:rows] = 255
        Image.fromarray(mask).save(folder / "mask.png")
        for _ in range(2):
            _ = Scene.open(folder).real_materials
    assert len(looks) == 2


def test_declared_means_declared_only(tmp_path: Path, looks: list[frozenset[str]]) -> None:
    scene = Scene.open(scene_with(tmp_path / "a", SHELF, 'gloss = "declared"'))
    assert [material.name for material in scene.real_materials] == ["shelf"]
    assert looks == []


def test_tiny_panoramas_are_not_searched(tmp_path: Path, looks: list[frozenset[str]]) -> None:
    assert Scene.open(scene_with(tmp_path / "a", height=32)).real_materials == ()
    assert looks == []


def test_info_tells_the_evidence(
    tmp_path: Path, looks: list[frozenset[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["scene", "info", str(scene_with(tmp_path / "a"))]) == 0
    shown = capsys.readouterr().out.splitlines()
    (line,) = [text for text in shown if text.startswith("glossy")]
    assert line.startswith("glossy     floor: plastic, alpha 0.12; ")
    assert line.endswith("found: alpha 0.1 to 0.14, strength 0.80 ± 0.07, t = 12")
    assert "diffuse    wall (yaw 90, pitch 0): no sign of a reflection (t = 1.2)" in shown
    assert len(looks) == 1


def test_what_is_found_is_printed_as_tables(
    tmp_path: Path, looks: list[frozenset[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = scene_with(tmp_path / "a", video='gloss = "declared"')
    before = (folder / "scene.toml").read_text()
    assert cli.main(["scene", "gloss", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert "# diffuse: wall (yaw 90, pitch 0): no sign of a reflection (t = 1.2)" in printed
    (table,) = tomllib.loads(printed)["real_materials"]
    assert table["name"] == "floor"
    assert table["alpha"] == pytest.approx(0.12)
    assert table["plane"] == {"point": [0, -1.3, 0], "normal": [0, 1, 0], "tolerance": 0.01}
    assert (folder / "scene.toml").read_text() == before


def test_what_is_written_is_the_scene_as_it_was_found(
    tmp_path: Path, looks: list[frozenset[str]]
) -> None:
    folder = scene_with(tmp_path / "a", SHELF)
    found = Scene.open(folder).frame().gloss
    assert cli.main(["scene", "gloss", str(folder), "--write"]) == 0
    written = Scene.open(folder)
    assert [m.name for m in written.declared_materials] == ["shelf", "floor"]
    region = written.declared_materials[1].region(written.frame())
    assert found is not None
    np.testing.assert_array_equal(region, found == 1)


def test_nothing_found_is_said(
    tmp_path: Path,
    looks: list[frozenset[str]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(search, "find_gloss", lambda *_: GlossSearch())
    folder = scene_with(tmp_path / "a")
    assert cli.main(["scene", "gloss", str(folder), "--write"]) == 0
    assert capsys.readouterr().out == "# box: no surface shows a reflection that is surely one\n"
    assert "real_materials" not in (folder / "scene.toml").read_text()
