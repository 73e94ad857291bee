"""Edits of light written to `[video]`: they are read back unchanged, and comments stay."""

from __future__ import annotations

from pathlib import Path

import pytest

from iprt.errors import SceneError
from iprt.footage.video.video_table import SunTable
from iprt.scene.edit_writing import save_edits
from iprt.scene.light_edits import LightEdit, angles_of, sun_table, towards
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, VIEW, write_scene

SUN = sun_table((0.6, 0.8, 0.0), (21.0, 19.0, 16.0), 0.53)
WORD = 'sun = "none"  # mine\nfps = 3.0  # slow\n\n# the views\n'
TABLE = "fps = 3.0\n\n[video.sun]  # seen\ndirection = [0, 1, 0]  # up\nirradiance = [1, 1, 1]\n"
EDITS = [
    LightEdit(sun=SUN),
    LightEdit("declared", "auto", "none"),
    LightEdit("declared", SUN),
    LightEdit(sun="none"),
]


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("text", [WORD, TABLE + "\n# the views\n", TABLE, "", "# end\n"])
def test_what_is_written_is_read_again(tmp_path: Path, edit: LightEdit, text: str) -> None:
    folder = write_scene(tmp_path / "a", MANIFEST + text + VIEW)
    scene = Scene.open(folder)
    save_edits(scene, (), light=edit)
    assert Scene.open(folder).manifest.video == edit.applied(scene.manifest.video)
    written = (folder / "scene.toml").read_text()
    assert written.startswith(MANIFEST)
    # A comment beside a table goes with it.
    gone = ("# seen", "# up") if isinstance(edit.sun, str) else ()
    comments = [line[line.index("#") :] for line in text.splitlines() if "#" in line]
    assert all(comment in written for comment in comments if comment not in gone)
    if "# the views" in text:
        assert written.endswith("\n# the views\n" + VIEW)


def test_no_edit_changes_no_byte(tmp_path: Path) -> None:
    folder = write_scene(tmp_path / "a", MANIFEST + TABLE)
    save_edits(Scene.open(folder), (), light=LightEdit())
    assert (folder / "scene.toml").read_text() == MANIFEST + TABLE


def test_edits_are_compared_by_their_parts() -> None:
    one, other = LightEdit("declared", SUN), LightEdit("declared", "none", "none")
    assert one.differing(other) == ("sun", "sky")
    assert one.besides(other) == LightEdit(sun=SUN)
    assert one.besides(one) == LightEdit()
    again = sun_table(SUN.direction, SUN.irradiance, SUN.angle_deg)
    assert again == SUN
    assert isinstance(again, SunTable)


def test_directions_are_turned_into_angles_and_back() -> None:
    assert towards(90.0, 0.0) == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)
    assert towards(0.0, 0.0) == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)
    assert towards(20.0, 90.0) == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    for angles in ((12.0, 34.0), (-170.0, -80.0), (0.0, 90.0)):
        assert angles_of(towards(*angles)) == pytest.approx(angles)


@pytest.mark.parametrize(
    ("direction", "irradiance", "angle_deg", "word"),
    [
        ((0, 0, 0), (1, 1, 1), 0.5, "direction"),
        ((0, float("nan"), 1), (1, 1, 1), 0.5, "direction"),
        ((0, 1, 0), (0, 0, 0), 0.5, "irradiance"),
        ((0, 1, 0), (1, 1e9, 1), 0.5, "irradiance"),
        ((0, 1, 0), (1, 1, 1), 20.0, "angle_deg"),
    ],
)
def test_suns_that_no_scene_has_are_one_line(
    direction: tuple[float, ...], irradiance: tuple[float, ...], angle_deg: float, word: str
) -> None:
    with pytest.raises(SceneError, match=f"^the sun: {word}.*: expected .*$"):
        sun_table(direction, irradiance, angle_deg)
