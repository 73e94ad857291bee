"""The plumbing of comparisons: a fake renderer whose picture, and so whose score, is known."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt.commands.compare import OVER_PANORAMA, compare
from iprt.commands.measurement_flags import MeasurementFlags
from iprt.device.profile import PassTime, Profile
from iprt.errors import FormatError, IprtError, SceneError
from iprt.geometry.camera import View
from iprt.measure import metrics
from iprt.measure.compare import Compared, compare_views
from iprt.measure.view_truth import views_with_truth
from iprt.output.display import display
from iprt.output.exr import write_exr
from iprt.settings.methods import methods
from iprt.settings.model import Settings

PLANNED_BYTES = 12_345_678
MADE = {"protocol": 1, "scene": "room", "scene_hash": "0123456789abcdef", "iprt": "0.1.0"}
CUTS = ((2, 3, 20, 22), (0, 0, 40, 32))


class FakeProfile(Profile):
    """Two passes that take 20 ms together, however many the frames."""

    def passes(self) -> list[PassTime]:
        return [PassTime("march", 15.0, 0.0, 1), PassTime("raster", 0.0, 5.0, 0)]


class FakeRenderer:
    """Renders the background it is given, else the truth; the method `ibl` doubles it."""

    calls: list[dict[str, Any]]
    picture: NDArray[np.float32]

    def __init__(
        self,
        device: Any,
        frame: Any,
        instances: Any,
        view: View,
        settings: Settings,
        *,
        background: NDArray[np.float32] | None,
    ) -> None:
        self.device, self.settings, self.background = device, settings, background
        given = {"frame": frame, "instances": instances, "view": view, "settings": settings}
        self.calls.append({**given, "background": background})
        device.profile.frames = 99  # preparation, which must not count

    def __enter__(self) -> FakeRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def render(self, frames: int, progress: Callable[[int], None] | None) -> SimpleNamespace:
        self.calls[-1]["frames"] = frames
        self.device.profile.frames += frames
        if progress is not None:
            progress(frames)
        color = self.picture if self.background is None else self.background
        return SimpleNamespace(color=color * (2.0 if self.settings.method == "ibl" else 1.0))


@pytest.fixture
def renderer(monkeypatch: pytest.MonkeyPatch, truth: NDArray[np.float32]) -> type[FakeRenderer]:
    monkeypatch.setattr(FakeRenderer, "calls", [], raising=False)
    monkeypatch.setattr(FakeRenderer, "picture", truth, raising=False)
    module = ModuleType("iprt.renderer")
    module.Renderer = FakeRenderer  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "iprt.renderer", module)
    plan = SimpleNamespace(bytes=PLANNED_BYTES)
    monkeypatch.setattr("iprt.memory.require_memory", lambda *_, **__: plan)
    return FakeRenderer


@pytest.fixture
def truth() -> NDArray[np.float32]:
    rng = np.random.default_rng(11)
    return rng.random((32, 40, 3)).astype(np.float16).astype(np.float32) * 0.5


@pytest.fixture
def scene(tmp_path: Path, truth: NDArray[np.float32]) -> Any:
    """A view with a truth and a darker background, and one without."""
    write_exr(tmp_path / "truth.exr", truth)
    write_exr(tmp_path / "background.exr", 0.5 * truth)
    compared = SimpleNamespace(
        view=View(40, 32),
        truth=tmp_path / "truth.exr",
        truth_background=tmp_path / "background.exr",
        truth_warning=None,
        cuts=CUTS,
        objects=("bunny",),
    )
    plain = SimpleNamespace(
        view=View(40, 32), truth=None, truth_background=None, cuts=(), objects=()
    )
    return SimpleNamespace(
        name="room",
        exposure=1.5,
        settings_table=({}, "scene.toml"),
        views={"plain": plain, "table": compared},
        frame=lambda index: f"frame {index}",
        instances_named=lambda names: names,
        root=tmp_path,
        require_not_ours=lambda path: None,
        frame_indices=range(1),
    )


IPRT, IBL = Settings(), Settings(method="ibl")


def run(scene: Any, *variants: Settings, **kwargs: Any) -> list[Compared]:
    device: Any = SimpleNamespace(profile=FakeProfile(), name="a device", finish=lambda: None)
    names = views_with_truth(scene)
    return list(compare_views(scene, names, variants or (IPRT,), device=device, **kwargs))


def test_perfect_render_scores_perfectly(scene: Any, renderer: type[FakeRenderer]) -> None:
    (result,) = run(scene, Settings(seed=9), frames=5)
    found = result.comparison
    assert (found.view, found.method, found.background) == ("table", "iprt", "panorama")
    assert found.scores.ssim == pytest.approx(1.0)
    assert found.scores.ssim_cuts == pytest.approx([1.0, 1.0])
    assert (found.scores.mse, found.scores.psnr) == (0.0, np.inf)
    assert (found.ms, found.bytes) == ({"march": 3.0, "raster": 1.0}, PLANNED_BYTES)
    assert renderer.calls == [
        {
            "frame": "frame 0",
            "instances": ("bunny",),
            "view": scene.views["table"].view,
            "settings": Settings(seed=9),
            "background": None,
            "frames": 5,
        }
    ]


def test_scores_are_those_of_the_displayed_images(
    scene: Any, renderer: type[FakeRenderer], truth: NDArray[np.float32]
) -> None:
    iprt, ibl = run(scene, IPRT, IBL, frames=1)
    shown, target = display(2.0 * truth, 1.5), display(truth, 1.5)
    assert ibl.comparison.method == "ibl"
    assert ibl.comparison.scores.ssim == metrics.ssim(shown, target) < iprt.comparison.scores.ssim
    x0, y0, x1, y1 = CUTS[0]
    cut = metrics.ssim(shown[y0:y1, x0:x1], target[y0:y1, x0:x1])
    assert ibl.comparison.scores.ssim_cuts[0] == cut
    assert ibl.comparison.scores.mse == pytest.approx(np.mean((shown - target) ** 2))
    assert ibl.comparison.scores.psnr == pytest.approx(-10 * np.log10(ibl.comparison.scores.mse))
    assert ibl.comparison.scores.flip == metrics.flip(shown, target)


def test_truth_background_reaches_the_renderer(
    scene: Any, renderer: type[FakeRenderer], truth: NDArray[np.float32]
) -> None:
    (result,) = run(scene, background="truth", frames=1)
    np.testing.assert_array_equal(renderer.calls[0]["background"], 0.5 * truth)
    assert result.comparison.background == "truth"
    np.testing.assert_array_equal(result.render, display(0.5 * truth, 1.5))


def test_panels_show_render_truth_and_difference(scene: Any, renderer: type[FakeRenderer]) -> None:
    (result,) = run(scene, background="truth", frames=1)
    render, truth, difference = np.split(result.panels(), 3, axis=1)
    np.testing.assert_array_equal(render, result.render)
    np.testing.assert_array_equal(truth, result.target.shown)
    np.testing.assert_allclose(difference, np.minimum(4 * np.abs(render - truth), 1))


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["plain"], r"views\.plain\.truth is not set"),
        (["tabel"], r"'tabel'.*plain, table"),
        ([], "no view has a truth"),
    ],
)
def test_views_without_truth_are_errors(scene: Any, names: list[str], message: str) -> None:
    if not names:
        del scene.views["table"]
    with pytest.raises(SceneError, match=message):
        views_with_truth(scene, names)


def test_a_truth_that_is_outdated_is_warned_of(
    scene: Any, caplog: pytest.LogCaptureFixture
) -> None:
    assert views_with_truth(scene) == ["table"]
    assert caplog.messages == []
    scene.views["table"].truth_warning = "views.table.truth: it is old"
    assert views_with_truth(scene) == ["table"]
    assert caplog.messages == ["views.table.truth: it is old"]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        ({"truth": "gone.exr"}, r"views\.table\.truth: there is no file"),
        ({"truth_background": None}, r"views\.table\.truth_background is not set"),
        ({"view": View(41, 32)}, r"truth\.exr: 40x32 pixels, but views\.table\.size is 41x32"),
        ({"cuts": ((0, 0, 8, 20),)}, r"views\.table\.cuts: the cut .* too few for SSIM"),
        ({"cuts": ((0, 0, 50, 20),)}, r"views\.table\.cuts: .* not inside"),
    ],
)
def test_faults_of_the_truth_are_found_before_rendering(
    spoil: dict[str, Any], message: str, scene: Any, renderer: type[FakeRenderer]
) -> None:
    if "truth" in spoil:
        spoil["truth"] = scene.root / spoil["truth"]
    vars(scene.views["table"]).update(spoil)
    with pytest.raises((SceneError, FormatError), match=message):
        run(scene, background="truth")
    assert renderer.calls == []


def test_video_is_compared_at_the_first_frame_with_a_truth(
    scene: Any, renderer: type[FakeRenderer], truth: NDArray[np.float32]
) -> None:
    scene.frame_indices = range(3, 9)
    write_exr(scene.root / "truth.0005.exr", 0.9 * truth)
    write_exr(scene.root / "truth.0007.exr", 0.8 * truth)
    write_exr(scene.root / "background.5.exr", 0.9 * truth)
    entry = scene.views["table"]
    entry.truth = scene.root / "truth.%04d.exr"
    entry.truth_background = scene.root / "background.%d.exr"
    (result,) = run(scene, background="truth", frames=1)
    assert renderer.calls[0]["frame"] == "frame 5"
    assert result.comparison.scores.mse == 0.0


@pytest.mark.parametrize("key", ["truth", "truth_background"])
def test_truth_with_nan_is_named(
    key: str, scene: Any, renderer: type[FakeRenderer], truth: NDArray[np.float32]
) -> None:
    truth[0, 0] = np.nan
    write_exr(getattr(scene.views["table"], key), truth)
    name = getattr(scene.views["table"], key).name
    with pytest.raises(FormatError, match=f"{name}: holds NaN"):
        run(scene, background="truth")
    assert renderer.calls == []


def test_render_with_nan_gets_no_score(
    scene: Any, renderer: type[FakeRenderer], truth: NDArray[np.float32]
) -> None:
    broken = truth.copy()
    broken[3, 4, 2] = np.nan
    renderer.picture = broken
    with pytest.raises(FormatError, match="view 'table', method iprt: the image holds 1 pixels"):
        run(scene)


@pytest.fixture
def command(
    monkeypatch: pytest.MonkeyPatch, scene: Any, renderer: type[FakeRenderer]
) -> Callable[..., int]:
    """`iprt compare` on the fake scene and device."""

    def module(name: str, **members: Any) -> None:
        fake = ModuleType(name)
        vars(fake).update(members)
        monkeypatch.setitem(sys.modules, name, fake)

    device = SimpleNamespace(profile=FakeProfile(), name="a device", finish=lambda: None)
    module("iprt.scene.scene", Scene=SimpleNamespace(open=lambda path, **_: scene))
    module("iprt.device.choose", choose_device=lambda spec: spec)
    monkeypatch.setattr("iprt.measure.protocol.provenance", lambda _: MADE)
    module("iprt.device.compute", ComputeDevice=lambda spec: device)

    def run(**given: Any) -> int:
        shared = {f.name: given.pop(f.name) for f in fields(MeasurementFlags) if f.name in given}
        flags = replace(OVER_PANORAMA, **shared)
        return compare(Path("room"), accumulate=2, measurement_flags=flags, **given)

    return run


def test_json_goes_to_stdout_alone(
    command: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(method=("all",), json=True) == 0
    printed = json.loads(capsys.readouterr().out)
    records = printed.pop("results")
    assert printed == MADE
    assert [record["method"] for record in records] == list(methods())
    psnr = {record["method"]: record["scores"]["psnr"] for record in records}
    assert psnr["iprt"] is None, "infinity is no JSON"
    assert psnr["ibl"] > 0.0


def test_table_has_a_row_per_method_named_in_any_way(
    command: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    for given in (("ibl", "iprt", "ibl"), ("ibl, iprt",), ("iprt", "ibl,iprt")):
        assert command(view=("table",), method=given) == 0
        text = capsys.readouterr().out
        lines = [line.split() for line in text.splitlines() if "table" in line]
        assert [line[:3] for line in lines] == [["table", "iprt", "1.0000"], ["table", "ibl", ANY]]
    assert "scene room (0123456789abcdef)" in text


def test_a_still_may_be_smaller(
    command: Callable[..., int],
    scene: Any,
    renderer: type[FakeRenderer],
    truth: NDArray[np.float32],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It is compared with means of the truth's pixels."""
    scene.views["table"].cuts = CUTS[1:]
    renderer.picture = truth.reshape(16, 2, 20, 2, 3).mean(axis=(1, 3))
    assert command(size=(20, 16), json=True) == 0
    (record,) = json.loads(capsys.readouterr().out)["results"]
    scores = record["scores"]
    assert (scores["ssim"], scores["rmse"]) == pytest.approx((1.0, 0.0), abs=1e-6)
    assert renderer.calls[0]["view"] == View(20, 16)
    with pytest.raises(IprtError, match="--size 40 30: the truth of view 'table'"):
        command(size=(40, 30))
    with pytest.raises(IprtError, match="--size 20 16: pictures of --pictures"):
        command(size=(20, 16), pictures=(Path("elsewhere"),), method=("iprt",))


@pytest.mark.parametrize(
    ("method", "limit", "status"), [("iprt", 1.0 - 1e-9, 0), ("iprt", None, 0), ("all", 0.999, 1)]
)
def test_a_missed_threshold_is_status_1(
    method: str, limit: float | None, status: int, command: Callable[..., int]
) -> None:
    assert command(method=(method,), fail_under_ssim=limit) == status


def test_saved_pictures(command: Callable[..., int], tmp_path: Path) -> None:
    assert command(save=tmp_path / "new" / "panels", method=("all",)) == 0
    names = sorted(path.name for path in (tmp_path / "new" / "panels").iterdir())
    assert names == [f"table-{name}-panorama.png" for name in sorted(methods())]
    with Image.open(tmp_path / "new" / "panels" / names[0]) as image:
        assert image.size == (120, 32)
        assert json.loads(image.text["iprt:scores"])["method"] == "dit"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "arguments",
    [{"accumulate": 0}, {"seed": -1}, {"fail_under_ssim": 1.5}, {"fail_under_ssim": float("nan")}],
)
def test_bad_values_are_refused(arguments: dict[str, Any]) -> None:
    flag = next(iter(arguments)).replace("_", "-")
    with pytest.raises(IprtError, match=f"--{flag}"):
        compare(Path("room"), **arguments)
