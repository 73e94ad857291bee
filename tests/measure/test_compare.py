"""Pictures against a scene's truth: scores, refusals, files, and the provenance of results."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt import cli
from iprt.commands.compare import _asked
from iprt.errors import FormatError, SceneError
from iprt.files.images import read_color
from iprt.measure import metrics, protocol
from iprt.measure.compare import Compared, scored
from iprt.measure.pictures import compare_pictures
from iprt.measure.protocol import provenance, scene_hash
from iprt.measure.view_truth import read_target, views_with_truth
from iprt.output.display import display
from iprt.output.picture import write_exr
from iprt.scene.scene import Scene
from iprt.settings.methods import methods
from tests.clips import write_clip
from tests.measure.tiny import write_tiny
from tests.scene.files import write_rgb

PAGE = Path(__file__).parents[2] / "docs" / "protocol.md"
DEVICE = ["--device", "pocl"]
QUICK = ["--accumulate", "2", *DEVICE]


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """Two equal views with one truth, and a darker background."""
    folder = write_tiny(tmp_path / "room", "near", "again")
    truth = 0.5 * np.random.default_rng(3).random((36, 48, 3), np.float32)
    write_exr(folder / "truth.exr", truth)
    return folder


@pytest.fixture
def mine(room: Path, tmp_path: Path) -> Path:
    """Pictures: twice as bright as the truth in one view, the truth itself in the other."""
    folder = tmp_path / "mine"
    folder.mkdir()
    write_exr(folder / "near.exr", 2.0 * read_color(room / "truth.exr"))
    shutil.copy(room / "truth.exr", folder / "again.exr")
    return folder


@pytest.fixture
def compared(capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, Any]]:
    """The output of `iprt compare --json`."""

    def run(*words: object) -> dict[str, Any]:
        capsys.readouterr()
        assert cli.main(["compare", *map(str, words), "--json"]) == 0
        found: dict[str, Any] = json.loads(capsys.readouterr().out)
        return found

    return run


def near(room: Path, mine: Path) -> Compared:
    (found,) = compare_pictures(Scene.open(room), ["near"], mine, "panorama")
    return found


# Scores ------------------------------------------------------------------------------------------


def test_scores_are_of_the_displayed_images(room: Path, mine: Path) -> None:
    found = near(room, mine)
    exposure = Scene.open(room).exposure
    truth = read_color(room / "truth.exr")
    shown, target = display(read_color(mine / "near.exr"), exposure), display(truth, exposure)
    scores = found.comparison.scores
    assert scores.ssim == metrics.ssim(shown, target)
    assert 0.1 < scores.ssim < 0.99
    for (x0, y0, x1, y1), ssim in zip(found.target.cuts, scores.ssim_cuts, strict=True):
        assert ssim == metrics.ssim(shown[y0:y1, x0:x1], target[y0:y1, x0:x1])
    assert scores.mse == pytest.approx(np.mean((shown - target) ** 2))
    assert scores.psnr == pytest.approx(-10 * np.log10(scores.mse))
    assert scores.rmse == pytest.approx(np.sqrt(np.mean(truth.astype(float) ** 2)), rel=1e-3)
    assert scores.flip == metrics.flip(shown, target)
    render, shown_truth, difference = np.split(found.panels(), 3, axis=1)
    np.testing.assert_array_equal(render, shown)
    np.testing.assert_array_equal(shown_truth, target)
    np.testing.assert_allclose(difference, np.minimum(4 * np.abs(shown - target), 1))


def test_a_picture_with_nan_gets_no_score(room: Path) -> None:
    target = read_target(Scene.open(room), "near", "truth")
    broken = target.radiance.copy()
    broken[3, 4, 2] = np.nan
    with pytest.raises(FormatError, match="view 'near', method x: the image holds 1 pixels"):
        scored(target, broken, "method x")


@pytest.mark.thorough
@pytest.mark.gl
def test_rendered_pictures_have_the_scores_of_their_files(
    room: Path, tmp_path: Path, compared: Callable[..., dict[str, Any]]
) -> None:
    """Beside them in one table; over the truth's background, only relighting differs."""
    mine = tmp_path / "mine"
    mine.mkdir()
    words = ["render", room, "--view", "near", "--accumulate", 2, "-o", mine / "near.exr", *DEVICE]
    assert cli.main([*map(str, words)]) == 0
    words = ["--pictures", mine, "--method", "iprt", "--view", "near", *QUICK]
    given, ours = compared(room, *words)["results"]
    assert (given["method"], given["ms"], given["bytes"]) == ("mine", {}, 0)
    assert ours["method"] == "iprt"
    assert ours["ms"]["composite"] > 0.0
    assert ours["bytes"] > 0
    for name, value in given["scores"].items():
        # Files hold half floats.
        same = value if value is None else pytest.approx(value, abs=2e-3)
        assert ours["scores"][name] == same, name
    words = ["--background", "truth", "--view", "near", "--method", "ibl", *QUICK]
    (over,) = compared(room, *words)["results"]
    assert over["background"] == "truth"
    assert over["scores"]["ssim"] > ours["scores"]["ssim"], "most of it is the truth"


@pytest.mark.gl
def test_methods_may_be_named_in_any_way(
    room: Path, compared: Callable[..., dict[str, Any]]
) -> None:
    """Repeated, or separated by commas; each is rendered once, in the order of `iprt methods`."""
    given = ["--method", "ibl, em", "--method", "ibl", "--view", "near,near", *QUICK]
    names = [result["method"] for result in compared(room, *given)["results"]]
    assert names == [name for name in methods() if name in ("em", "ibl")] * 2


def test_all_methods_may_be_asked_for() -> None:
    assert _asked(["ibl", "all"]) == list(methods())


# Truth -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["again"], r"views\.again\.truth is not set"),
        (["naer"], r"'naer'.*near, again"),
        ([], "no view has a truth"),
    ],
)
def test_views_without_truth_are_errors(room: Path, names: list[str], message: str) -> None:
    head, tail = (room / "scene.toml").read_text().rsplit("[[views]]", 1)
    head = head if names else head.replace("truth", "# truth")
    (room / "scene.toml").write_text(f"{head}[[views]]{tail.replace('truth', '# truth')}")
    with pytest.raises(SceneError, match=message):
        views_with_truth(Scene.open(room), names)


def test_a_truth_that_is_outdated_is_warned_of(
    room: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert views_with_truth(Scene.open(room)) == ["near", "again"]
    assert caplog.messages == []
    manifest = (room / "scene.toml").read_text()
    old = manifest.replace("truth =", "truth_outdated = true\ntruth =", 1)
    (room / "scene.toml").write_text(old)
    views_with_truth(Scene.open(room))
    (line,) = caplog.messages
    assert "views.near.truth" in line


def spoiled(values: NDArray[np.float32]) -> Callable[[Path], object]:
    return lambda path: write_rgb(path, values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("truth.exr", "gone.exr"), r"views\.near\.truth: there is no file"),
        (("truth_background", "# "), r"views\.near\.truth_background is not set"),
        (("[48, 36]", "[52, 36]"), r"truth\.exr: 48x36 pixels, but views\.near\.size is 52x36"),
        (("39, 31]", "18, 31]"), r"views\.near\.cuts: the cut .* too few for SSIM"),
        (("", ""), r"truth\.exr: holds NaN"),
    ],
)
def test_faults_of_the_truth_are_named(room: Path, change: tuple[str, str], message: str) -> None:
    text = (room / "scene.toml").read_text()
    if change == ("", ""):
        write_rgb(room / "truth.exr", np.full((36, 48, 3), np.nan, np.float32))
    else:
        assert change[0] in text
        (room / "scene.toml").write_text(text.replace(*change))
    with pytest.raises((SceneError, FormatError), match=message):
        read_target(Scene.open(room), "near", "truth")


# Pictures from elsewhere -------------------------------------------------------------------------


def test_frames_of_a_video_are_named_by_their_numbers(
    tmp_path: Path, compared: Callable[..., dict[str, Any]]
) -> None:
    folder = write_clip(tmp_path / "clip", 4, first=2)
    manifest = folder / "scene.toml"
    manifest.write_text(manifest.read_text() + 'truth = "truth.%d.exr"\n')
    (tmp_path / "mine").mkdir()
    for index, level in ((3, 0.2), (5, 0.4)):
        write_rgb(folder / f"truth.{index}.exr", np.full((16, 32, 3), 0.4, np.float32))
        write_rgb(tmp_path / f"mine/ahead.000{index}.exr", np.full((16, 32, 3), level, np.float32))
    assert read_target(Scene.open(folder), "ahead", "panorama").index == 3, "the first with a truth"
    dark, right = compared(folder, "--pictures", tmp_path / "mine")["results"]
    assert [dark["view"], right["view"]] == ["ahead 3", "ahead 5"]
    assert dark["scores"]["rmse"] == pytest.approx(0.2, rel=1e-3)
    assert (right["scores"]["rmse"], right["scores"]["ssim"]) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "spoil", "message"),
    [
        ("near.exr", lambda p: p.unlink(), "near.exr: there is no such picture"),
        ("naer.exr", lambda p: p.touch(), "naer.exr: is no view of box with a truth"),
        ("near.exr", spoiled(np.zeros((18, 24, 3), "f4")), "24x18 pixels, but the truth"),
        ("near.exr", spoiled(np.full((36, 48, 3), np.nan, "f4")), "holds NaN or infinite"),
        ("near.exr", lambda p: p.write_bytes(b"\x89PNG"), "is no EXR picture"),
        ("near.exr", lambda p: p.write_bytes(b"v/1\x01cut off"), "near.exr: "),
    ],
)
def test_faults_of_pictures_are_named(
    room: Path,
    mine: Path,
    name: str,
    spoil: Callable[[Path], object],
    message: str,
    fails: Callable[..., str],
) -> None:
    spoil(mine / name)
    assert message in fails("compare", room, "--pictures", mine)


# Output ------------------------------------------------------------------------------------------


def test_json_holds_the_provenance_and_no_infinity(
    room: Path, mine: Path, compared: Callable[..., dict[str, Any]]
) -> None:
    found = compared(room, "--pictures", mine)
    doubled, perfect = found.pop("results")
    assert found == provenance(Scene.open(room))
    assert (doubled["view"], doubled["method"], doubled["background"]) == (
        "near", "mine", "panorama",
    )  # fmt: skip
    assert (perfect["scores"]["ssim"], perfect["scores"]["psnr"]) == (1.0, None)


@pytest.mark.parametrize("more", [[], ["--markdown"]])
def test_tables_say_where_their_figures_are_from(
    room: Path, mine: Path, more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["compare", str(room), "--pictures", str(mine), *more]) == 0
    text = capsys.readouterr().out
    rows = [line.replace("|", " ").split()[:3] for line in text.splitlines()]
    assert ["again", "mine", "1.0000"] in rows
    assert f"scene box ({scene_hash(Scene.open(room))})" in text


@pytest.mark.parametrize(
    ("view", "limit", "status"), [("again", "0.999999", 0), ("near", "0.999999", 1)]
)
def test_a_missed_threshold_is_status_1(
    room: Path, mine: Path, view: str, limit: str, status: int
) -> None:
    words = ["compare", room, "--pictures", mine, "--view", view, "--fail-under-ssim", limit]
    assert cli.main([str(word) for word in words]) == status


def test_saved_panels_hold_their_scores(room: Path, mine: Path, tmp_path: Path) -> None:
    saved = tmp_path / "new" / "panels"
    assert cli.main(["compare", str(room), "--pictures", str(mine), "--save", str(saved)]) == 0
    names = sorted(path.name for path in saved.iterdir())
    assert names == ["again-mine-panorama.png", "near-mine-panorama.png"]
    with Image.open(saved / names[0]) as image:
        assert image.size == (3 * 48, 36)
        assert json.loads(image.info["iprt:scores"])["scores"]["ssim"] == 1.0


@pytest.mark.parametrize(
    "words",
    [
        "--accumulate 0",
        "--seed -1",
        "--fail-under-ssim 1.5",
        "--fail-under-ssim nan",
        "--size 40 30",
        "--size 24 18 --pictures mine",
    ],
)
def test_bad_values_are_refused(room: Path, words: str, fails: Callable[..., str]) -> None:
    assert words.partition(" --pictures")[0] in fails("compare", room, *words.split())


def test_a_scene_has_the_hash_of_its_contents(room: Path, tmp_path: Path) -> None:
    """Of the values in its manifest, however written; a copy has it too, under any name."""
    copy = shutil.copytree(room, tmp_path / "copy")
    manifest = copy / "scene.toml"
    text = manifest.read_text()
    other = text.replace('name = "box"', 'name = "copy"', 1)
    default = other.replace("pitch_deg", "yaw_deg = 0.0\npitch_deg", 1)
    manifest.write_text(f"# A comment.\n{default}")
    own = scene_hash(Scene.open(room))
    assert scene_hash(Scene.open(copy)) == own
    changed = {own}
    for name in ("color.exr", "truth.exr", "cube.obj"):
        before = (copy / name).read_bytes()
        (copy / name).write_bytes(before + b"\n")
        changed.add(scene_hash(Scene.open(copy)))
        (copy / name).write_bytes(before)
    manifest.write_text(text.replace("pitch_deg = -35", "pitch_deg = -34", 1))
    changed.add(scene_hash(Scene.open(copy)))
    assert len(changed) == 5


def test_the_protocol_agrees_with_its_page(room: Path) -> None:
    """The page's version, and the numbers of its metrics."""
    page = PAGE.read_text(encoding="utf-8")
    assert page.startswith(f"# The protocol of comparisons, version {protocol.VERSION}\n")
    told = (f"window of {metrics.SSIM_WINDOW} pixels", f"σ {metrics.SSIM_SIGMA}")
    assert all(text in page for text in (*told, f"{metrics.FLIP_PPD:g} pixels per degree"))
