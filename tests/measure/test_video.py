"""Playing a video and measuring it: films whose truth and flicker are known, and a real one."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt import cli
from iprt.commands.compare_video import VideoFlags
from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.measure.combinations import Combination, combinations
from iprt.measure.film_strip import COLUMNS, FilmStrip
from iprt.measure.stability import CAUSES
from iprt.measure.stability_report import stability_grid
from iprt.measure.video_stability import Player, over_background, resized
from iprt.output.display import display
from iprt.output.picture import write_exr
from iprt.scene.scene_view import SceneView
from iprt.settings.model import Settings
from tests.frame.moving import write_moving

HEIGHT, WIDTH, FRAMES = 32, 40, 6
COVERED, CHANGED = slice(4, 16), slice(16, 28)
"""Rows that an object covers, and that it darkens."""

Picture = NDArray[np.float32]


def background(index: int) -> Picture:
    """What the camera sees: it gets brighter."""
    rng = np.random.default_rng(1)
    return (0.2 + 0.01 * index + 0.3 * rng.random((HEIGHT, WIDTH, 3))).astype(np.float32)


def true_picture(index: int) -> Picture:
    color = background(index)
    color[COVERED] = 0.5
    color[CHANGED] *= 0.75
    return color


class FakeFilm:
    """Shows the truth, with noise if the settings' seed is not 0; each frame makes new noise."""

    made: list[tuple[Settings, int]]

    def __init__(
        self, scene: Any, device: Any, settings: Settings, *, view: Any, accumulate: int = 1
    ) -> None:
        self.settings, self.accumulate = settings, accumulate
        self.made.append((settings, accumulate))

    def __enter__(self) -> FakeFilm:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def frames(
        self, indices: Sequence[int], *, aovs: Iterable[str] = ()
    ) -> Iterator[tuple[int, Any]]:
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32) + np.float32(0.5)
        coverage = np.zeros((HEIGHT, WIDTH), np.float32)
        coverage[COVERED] = 1.0
        ratio = np.ones((HEIGHT, WIDTH, 3), np.float32)
        ratio[CHANGED] = 0.75
        for index in indices:
            color, seen = true_picture(index), background(index)
            if self.settings.seed == 7:
                noise = np.random.default_rng(100 + index).normal(size=color.shape)
                color[COVERED] += 0.01 * noise[COVERED].astype(np.float32)
            if self.settings.seed == 8:
                color[0, 0] = np.nextafter(color[0, 0], np.float32(1.0))
            layers = {
                "background": seen,
                "coverage": coverage,
                "ratio": ratio,
                "gloss": np.zeros((HEIGHT, WIDTH), np.float32),
                "depth": np.ones((HEIGHT, WIDTH), np.float32),
                "motion": np.stack([x, y], axis=-1),
            }
            yield index, SimpleNamespace(color=color, aovs={name: layers[name] for name in aovs})


@pytest.fixture
def film(monkeypatch: pytest.MonkeyPatch) -> type[FakeFilm]:
    monkeypatch.setattr(FakeFilm, "made", [], raising=False)
    module = ModuleType("iprt.film")
    module.Film = FakeFilm  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "iprt.film", module)
    return FakeFilm


@pytest.fixture
def scene(tmp_path: Path) -> Any:
    """Truths of frames 1, 2 and 4, and of their backgrounds, which are brighter."""
    for index in (1, 2, 4):
        write_exr(tmp_path / f"truth.{index}.exr", true_picture(index))
        write_exr(tmp_path / f"background.{index}.exr", 1.5 * background(index))
    view = SceneView(
        name="table",
        view=View(WIDTH, HEIGHT),
        objects=("ball",),
        truth=tmp_path / "truth.%d.exr",
        truth_background=tmp_path / "background.%d.exr",
        truth_mask=None,
        cuts=((2, 3, 20, 22),),
    )
    return SimpleNamespace(
        name="clip",
        exposure=1.2,
        root=tmp_path,
        views={"table": view},
        frame_indices=range(FRAMES),
    )


def player(scene: Any, *seeds: int, **kwargs: Any) -> Player:
    chosen = [Combination({"seed": seed}, Settings(seed=seed)) for seed in seeds]
    return Player(scene, scene.views["table"], chosen, device=SimpleNamespace(), **kwargs)


def test_the_truth_is_true_and_as_steady_as_its_input(scene: Any, film: type[FakeFilm]) -> None:
    played = player(scene, 0)
    moments = list(played.play(range(FRAMES)))
    assert [moment.index for moment in moments] == list(range(FRAMES))
    np.testing.assert_array_equal(moments[3].shown[0], display(true_picture(3), 1.2))
    assert moments[3].converged is None
    (result,) = played.results()
    assert list(result.scores) == [1, 2, 4]
    assert all(scores.mse == 0.0 for scores in result.scores.values())
    assert result.temporal_error == 0.0
    assert result.unequal == 0
    assert result.flicker["untouched"].ratio == 1.0
    assert result.flicker["untouched"].output > 0.001
    assert result.flicker["object"].output == 0.0
    # What is darker changes by less, and as displayed it is not quite three quarters.
    assert 0.7 < result.flicker["relit"].ratio < 1.0
    assert result.true_flicker["relit"].ratio == 1.0
    assert result.true_flicker["relit"].pixels == WIDTH * 12  # of one pair of truths
    assert result.flicker["relit"].pixels == (FRAMES - 1) * WIDTH * 12
    assert result.trails == {}
    assert result.worst_flicker == 1.0


def test_noise_is_found_where_it_is(scene: Any, film: type[FakeFilm]) -> None:
    played = player(scene, 0, 7)
    list(played.play(range(FRAMES)))
    clean, noisy = played.results()
    assert (clean.settings, noisy.settings) == ("seed=0", "seed=7")
    slope = np.diff(display(np.array([[[0.49] * 3, [0.51] * 3]]), 1.2)[0, :, 0])[0] / 0.02
    wanted = 0.01 * slope * 2.0 / np.sqrt(np.pi)
    assert noisy.flicker["object"].output == pytest.approx(wanted, rel=0.05)
    assert noisy.flicker["relit"] == clean.flicker["relit"]
    assert noisy.temporal_error == pytest.approx(0.01 * slope * np.sqrt(2.0 * 12 / HEIGHT), rel=0.1)


def test_a_bit_that_differs_is_counted(scene: Any, film: type[FakeFilm]) -> None:
    played = player(scene, 8)
    list(played.play(range(FRAMES)))
    (result,) = played.results()
    assert result.unequal == FRAMES
    assert f"({FRAMES} pixels differ)" in stability_grid([result], "panorama").rows[0][5]


def test_scores_over_the_background_of_the_truth(scene: Any, film: type[FakeFilm]) -> None:
    """The picture over another background is what Eq. 2 makes of that."""
    played = player(scene, 0, background="truth")
    list(played.play([1]))
    (result,) = played.results()
    target = SimpleNamespace(background=1.5 * background(1))
    ((_, picture),) = FakeFilm(None, None, Settings(), view=None).frames(
        [1], aovs=("background", "coverage", "ratio")
    )
    wanted = 1.5 * background(1)
    wanted[COVERED] = 0.5
    wanted[CHANGED] *= 0.75
    np.testing.assert_allclose(over_background(picture, target), wanted, rtol=1e-5)  # type: ignore[arg-type]
    assert result.scores[1].mse > 0.0
    assert result.flicker["untouched"].pixels == 0


def test_converged_pictures_have_no_past(scene: Any, film: type[FakeFilm]) -> None:
    """One film for each, of another seed, that averages all its frames."""
    played = player(scene, 0, converge=16)
    moments = list(played.play(range(3)))
    assert moments[2].converged is not None
    converged = film.made[1:]
    assert [accumulate for _, accumulate in converged] == [16] * 3
    assert {(settings.seed, settings.fading) for settings, _ in converged} == {(1, 0.0)}
    (result,) = played.results()
    assert all(trail.frames is None for trail in result.trails.values()), "nothing has left"
    assert set(result.trails) == set(CAUSES)


def test_a_view_in_another_size(scene: Any) -> None:
    view = resized(scene.views["table"], (WIDTH // 2, HEIGHT // 2))
    assert (view.view.width, view.view.height) == (20, 16)
    assert view.cuts == ((1, 1, 10, 11),)
    assert resized(scene.views["table"], None) is scene.views["table"]


def test_strip_shows_even_distances(tmp_path: Path) -> None:
    strip = FilmStrip(range(3, 33), [(0, 0, 4, 4), (2, 1, 12, 9)])
    for index in range(3, 33):
        shown = np.full((20, 20, 3), index / 255.0)
        strip.add(index, shown, np.zeros((20, 20, 3)))
    strip.write(tmp_path / "strip.png", {"a": 1})
    with Image.open(tmp_path / "strip.png") as image:
        assert image.size == (10 * COLUMNS, 8 * 3)
        pixels = np.asarray(image)
        assert image.info["iprt:frames"].split(", ")[0] == "3"
    assert pixels[0, ::10, 0].tolist() == [3, 7, 11, 15, 20, 24, 28, 32]
    assert not pixels[8:16].any()
    assert pixels[16, ::10, 0].tolist() == [4 * value for value in pixels[0, ::10, 0]]


def test_how_fast_history_fades_is_swept_of_videos_only() -> None:
    sweep = ["fading=0.05,1.0"]
    chosen = combinations("balanced", [], sweep, one_at_a_time=True, still=False)
    assert [each.label for each in chosen] == ["base", "fading=0.05", "fading=1.0"]
    with pytest.raises(IprtError, match="no effect on a still picture"):
        combinations("balanced", [], sweep, one_at_a_time=True)


@pytest.mark.parametrize(
    ("frames", "message"),
    [("2:1", "the first frame"), ("0:6", "no frame 6"), ("::2", "without gaps")],
)
def test_frames_that_cannot_be_played_are_refused(scene: Any, frames: str, message: str) -> None:
    with pytest.raises(IprtError, match=f"--frames {frames}: .*{message}"):
        VideoFlags(frames=frames).indices(scene)
    assert VideoFlags(frames="2:4").indices(scene) == range(2, 5)
    assert VideoFlags().indices(scene) == range(6)


def test_flags_for_videos_are_refused_for_pictures() -> None:
    with pytest.raises(IprtError, match="--trails: is for videos; room has a single frame"):
        VideoFlags(trails=True).require_none("room")
    with pytest.raises(IprtError, match="--fail-over-flicker nan"):
        VideoFlags(fail_over_flicker=float("nan")).check()


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip in which a real box, two objects and the view move; its truth is grey."""
    folder = tmp_path_factory.mktemp("clip")
    write_moving(folder, window=True)
    text = (folder / "scene.toml").read_text()
    lines = 'size = [128, 64]\ntruth = "truth.%d.exr"\ncuts = [[30, 10, 90, 60]]'
    (folder / "scene.toml").write_text(text.replace("size = [128, 64]", lines))
    for index in (1, 2):
        write_exr(folder / f"truth.{index}.exr", np.full((64, 128, 3), 0.3, np.float32))
    return folder


@pytest.mark.thorough
@pytest.mark.gl
def test_what_no_object_touches_is_as_steady_as_the_input(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """To the last bit, while everything moves; and the verb says so."""
    words = ["compare", str(clip), "--device", "pocl", "--size", "64", "32", "--json"]
    more = ["--frames", "0:2", "--accumulate", "4", "--trails", "--save", str(tmp_path / "saved")]
    assert cli.main([*words, *more, "--fail-over-flicker", "1e9"]) == 0
    (record,) = json.loads(capsys.readouterr().out)["results"]
    assert record["unequal"] == 0
    assert record["flicker"]["untouched"]["ratio"] == 1.0
    assert record["flicker"]["untouched"]["pixels"] > 20
    assert record["flicker"]["object"]["pixels"] > 50
    assert record["trails"]["object"]["ages"][0]["pixels"] > 10
    assert list(record["scores"]) == ["1", "2"]
    assert (tmp_path / "saved" / "ahead-base.png").exists()
    assert cli.main([*words, "--frames", "0:1", "--fail-over-flicker", "0.5"]) == 1
