"""Test `iprt render` of a video: rendered frames, left files, and continued renders."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from iprt.commands.join import join
from iprt.commands.setting_flags import SettingFlags
from iprt.errors import DeviceLostError, FormatError, IprtError
from iprt.files.lock import locked
from iprt.output.chunks import WARM_UP
from iprt.output.spatial_media import XML_ID
from iprt.scene.scene import Scene
from iprt.scene.scene_files import fingerprint
from tests.clips import write_clip
from tests.commands.conftest import FakeFilm
from tests.sounding import clicks_in, sound_codecs, write_sounding

Command = Callable[..., int]
Fails = Callable[..., str]


def shown(path: Path) -> list[int]:
    """Return the numbers of the frames in a video file, encoded in their green."""
    with av.open(str(path)) as container:
        greens = [frame.to_ndarray(format="rgb24")[8, 16, 1] for frame in container.decode(video=0)]
    values = ((np.array(greens) / 255.0 + 0.055) / 1.055) ** 2.4
    return [round(float(value) * 10.0) for value in values]


def contents(folder: Path) -> dict[str, object]:
    """Bytes of pictures; what films show and say: x264 may code one tiny film in several ways."""
    return {path.name: content(path) for path in folder.iterdir()}


def content(path: Path) -> object:
    if path.suffix != ".mp4":
        return path.read_bytes()
    with av.open(str(path)) as container:
        times = [packet.pts for packet in container.demux(video=0)]
        return shown(path), times, container.metadata


def rendered() -> list[int]:
    """Numbers of the frames that were asked of films, in all calls."""
    return [index for call in FakeFilm.calls for index in call[0]]


def test_a_file_holds_the_frames_in_order(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "out" / "a.mp4"
    assert command(output=path, frames="1:4") == 0
    assert shown(path) == [1, 2, 3, 4]
    ((indices, before, _, accumulate, settings),) = FakeFilm.calls
    assert (indices, before, accumulate) == ([1, 2, 3, 4], WARM_UP, 4)
    assert settings.fading > 0.0, "no still picture"
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == 24
        said = json.loads(container.metadata["comment"])
    assert said["iprt:span"] == "1:4:1"
    assert json.loads(said["iprt:settings"])["fading"] == settings.fading
    assert [each.name for each in path.parent.iterdir()] == ["a.mp4"]


def test_all_frames_without_a_range_and_steps_in_their_own_time(
    command: Command, tmp_path: Path
) -> None:
    command(output=tmp_path / "all.mkv")
    command(output=tmp_path / "steps.mov", frames="0:5:2")
    assert shown(tmp_path / "all.mkv") == [0, 1, 2, 3, 4, 5]
    assert shown(tmp_path / "steps.mov") == [0, 2, 4]
    with av.open(str(tmp_path / "steps.mov")) as container:
        assert container.streams.video[0].average_rate == 12


def test_numbered_pictures_have_the_numbers_of_the_frames(
    command: Command, folder: Path, tmp_path: Path
) -> None:
    command(output=tmp_path / "out" / "a.%03d.png", frames="1:5:2", accumulate=2)
    pictures = sorted((tmp_path / "out").iterdir())
    assert [path.name for path in pictures] == ["a.001.png", "a.003.png", "a.005.png"]
    with Image.open(pictures[1]) as image:
        told = image.info
    assert told["iprt:frame"] == "3"
    assert (told["iprt:frames"], told["iprt:device"]) == ("2", "a device")
    assert told["iprt:files"] == fingerprint(Scene.open(folder))


def test_a_number_and_a_name_make_a_still(command: Command, tmp_path: Path) -> None:
    command(output=tmp_path / "a.png", frames="3")
    ((indices, before, _, accumulate, settings),) = FakeFilm.calls
    assert (indices, before, accumulate, settings.fading) == ([3], 0, 64, 0.0)


@pytest.mark.parametrize("name", ["a.mp4", "%d.png"])
def test_whatever_ends_it_the_same_command_goes_on(
    name: str, command: Command, tmp_path: Path
) -> None:
    path = tmp_path / "out" / name
    FakeFilm.ends[3] = [FormatError("color.0003.exr: is damaged")]
    with pytest.raises(FormatError, match=r"color\.0003\.exr: is damaged") as caught:
        command(output=path)
    assert caught.value.__notes__ == [
        "3 of 6 frames finished; the same command continues from there"
    ]
    FakeFilm.calls.clear()
    assert command(output=path) == 0
    assert [(call[0], call[1]) for call in FakeFilm.calls] == [([3, 4, 5], WARM_UP)]
    whole = tmp_path / "whole" / name
    command(output=whole)
    assert contents(path.parent) == contents(whole.parent)


def test_nothing_to_do_says_so(
    command: Command,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO", "iprt")
    for name in ("a.mp4", "%d.png"):
        command(output=tmp_path / name)
        FakeFilm.calls.clear()
        capsys.readouterr()
        caplog.clear()
        before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.*")}
        assert command(output=tmp_path / name) == 0
        assert capsys.readouterr().out == f"{tmp_path / name}\n"
        (line,) = caplog.messages
        assert line == f"{tmp_path / name}: is finished already; delete it to render it again"
        assert FakeFilm.calls == []
        assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.*")} == before


def test_gaps_are_filled_by_rendering_their_chunk_anew(command: Command, tmp_path: Path) -> None:
    command(output=tmp_path / "%d.png")
    for index in (1, 2, 4):
        (tmp_path / f"{index}.png").unlink()
    FakeFilm.calls.clear()
    command(output=tmp_path / "%d.png")
    assert [(call[0], call[1]) for call in FakeFilm.calls] == [([1, 2, 4], WARM_UP)]


@pytest.mark.parametrize("name", ["a.mp4", "%d.exr"])
def test_chunks_apart_are_joined(
    name: str, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames 0 to 5 in chunks of 3: the first fades into the second over frame 2."""
    monkeypatch.setattr("iprt.output.chunks.WARM_UP", 2)
    flags = {"accumulate": 16, "chunk": 3}
    command(output=tmp_path / "whole" / name, **flags)
    path = tmp_path / "out" / name
    FakeFilm.calls.clear()
    assert command(output=path, chunks="1", **flags) == 0
    assert rendered() == [2, 3, 4, 5], "with its warm-up"
    assert not path.exists()
    with pytest.raises(IprtError) as caught:
        join(path)
    assert str(caught.value) == (
        f"{path}: 1 chunk of 2 missing: 0 (frames 0 to 2); render with --chunks 0"
    )
    command(output=path, chunks="0-1", **flags)
    assert rendered() == [2, 3, 4, 5, 0, 1, 2]
    assert join(path) == 0
    assert contents(path.parent) == contents(tmp_path / "whole")
    with pytest.raises(IprtError, match=r"has no folder .*; render its chunks first"):
        join(path)


def test_chunks_of_other_lengths_are_not_mixed(command: Command, tmp_path: Path) -> None:
    command(output=tmp_path / "%d.png", chunk=8, frames="0:3")
    with pytest.raises(FormatError, match="--chunk was 8 then and is 9 now"):
        command(output=tmp_path / "%d.png", chunk=9)


def test_join_names_a_sound_that_is_not_there(
    command: Command, folder: Path, tmp_path: Path
) -> None:
    source = write_sounding(folder / "color.ts", clicks=(0.05, 0.15, 0.25), seconds=0.4)
    manifest = folder / "scene.toml"
    text = manifest.read_text().replace("color.%04d.exr", "color.ts").replace("fps = 24.0\n", "")
    manifest.write_text(text)
    command(output=tmp_path / "a.mp4", chunks="0")
    shutil.move(source, tmp_path / "elsewhere.ts")
    with pytest.raises(IprtError, match=r"color\.ts: the film's sound is not there; join where"):
        join(tmp_path / "a.mp4")
    assert join(tmp_path / "a.mp4", no_audio=True) == 0
    assert sound_codecs(tmp_path / "a.mp4") == []


def test_other_settings_or_scenes_are_not_mixed_in(
    command: Command, folder: Path, tmp_path: Path
) -> None:
    FakeFilm.ends[3] = [KeyboardInterrupt(), KeyboardInterrupt()]
    for name in ("a.mp4", "%d.png"):
        with pytest.raises(KeyboardInterrupt):
            command(output=tmp_path / name)
        with pytest.raises(FormatError, match=r"settings\.trace\.rays was 1 then and is 2 now"):
            command(output=tmp_path / name, setting_flags=SettingFlags(set=("trace.rays=2",)))
        with pytest.raises(FormatError, match="--accumulate was 4 then and is 5 now"):
            command(output=tmp_path / name, accumulate=5)
    (folder / "cube.obj").touch()
    for name in ("a.mp4", "%d.png"):
        with pytest.raises(FormatError, match="the scene's files have changed since; delete"):
            command(output=tmp_path / name)
    assert rendered() == [0, 1, 2, 3, 4, 5] * 2


def test_a_device_may_be_lost_as_often_as_it_gets_further(
    command: Command, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    lost = DeviceLostError("a device gave up")
    FakeFilm.ends.update({1: [lost], 2: [lost], 4: [lost]})
    assert command(output=tmp_path / "a.mp4") == 0
    assert shown(tmp_path / "a.mp4") == [0, 1, 2, 3, 4, 5]
    assert [call[0][0] for call in FakeFilm.calls] == [0, 1, 2, 4]
    assert len(caplog.messages) == 3
    FakeFilm.ends[2] = [lost, lost]
    with pytest.raises(DeviceLostError, match="for the second time") as caught:
        command(output=tmp_path / "b.mp4")
    assert caught.value.__notes__[0].startswith("2 of 6 frames finished")


def test_panoramas_tell_players(
    command: Command, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    command(output=tmp_path / "a.mp4", view="equirect")
    assert not caplog.messages
    command(output=tmp_path / "a.mkv", view="equirect")
    (line,) = caplog.messages
    assert "only .mp4 and .mov can mark this as a panorama" in line
    command(output=tmp_path / "b.mp4")
    told = {name: XML_ID in (tmp_path / name).read_bytes() for name in ("a.mp4", "a.mkv", "b.mp4")}
    assert told == {"a.mp4": True, "a.mkv": False, "b.mp4": False}


def test_the_sound_of_a_video_file_is_kept(command: Command, folder: Path, tmp_path: Path) -> None:
    """The source clicks when its frames 1, 3 and 5 are shown."""
    write_sounding(folder / "color.ts", clicks=(0.05, 0.15, 0.25), seconds=0.4)
    manifest = folder / "scene.toml"
    text = manifest.read_text().replace("color.%04d.exr", "color.ts").replace("fps = 24.0\n", "")
    manifest.write_text(text)
    command(output=tmp_path / "all.mp4", view="equirect", size=(64, 32))
    command(output=tmp_path / "steps.mov", frames="1:5:2")
    command(output=tmp_path / "silent.mp4", no_audio=True)
    command(output=tmp_path / "before.mkv", frames="0:3")
    for name, expected in {
        "all.mp4": [0.05, 0.15, 0.25],
        "steps.mov": [0.0, 0.1, 0.2],
        "before.mkv": [0.05, 0.15],
    }.items():
        assert clicks_in(tmp_path / name) == pytest.approx(expected, abs=0.02), name
    assert sound_codecs(tmp_path / "silent.mp4") == []
    assert shown(tmp_path / "steps.mov") == [1, 3, 5]
    FakeFilm.calls.clear()
    command(output=tmp_path / "silent.mp4")
    assert rendered() == [0, 1, 2, 3, 4, 5]
    assert len(clicks_in(tmp_path / "silent.mp4")) == 3


def test_a_folder_takes_one_render_at_a_time(command: Command, tmp_path: Path) -> None:
    with locked(tmp_path / "out"), pytest.raises(FormatError, match="renders into this folder"):
        command(output=tmp_path / "out" / "a.mp4")
    assert FakeFilm.calls == []


BAD: dict[str, tuple[list[str], str]] = {
    "odd": (["-o", "OUT/a.mp4", "--size", "31", "16"], "31 x 16 pixels: video needs even sides"),
    "layers": (["-o", "OUT/a.mp4", "--aov", "depth"], "write numbered .exr files for --aov"),
    "png layers": (["-o", "OUT/%d.png", "--aov", "depth"], "holds no layers"),
    "backwards": (
        ["-o", "OUT/a.mp4", "--frames", "3:1"],
        "--frames 3:1: the first frame comes after the last",
    ),
    "beyond": (["-o", "OUT/a.mp4", "--frames", "0:6"], "no frame 6; the video has 0 to 5"),
    "one name": (["-o", "OUT/a.png", "--frames", "0:2"], "write a.%04d.png, or one of .mp4"),
    "two numbers": (["-o", "OUT/%d%d.png"], "expected one %d or %04d and no other %"),
    "kind": (["-o", "OUT/a.avi"], "unknown output format '.avi'; supported: .exr, .png, and for"),
    "numbered kind": (["-o", "OUT/%d.tif"], "unknown output format '.tif'"),
    "the video": (["-o", "OUT/room/color.%04d.exr"], "color.0000.exr: belongs to the scene"),
    "a folder": (["-o", "OUT/folder.mp4"], "folder.mp4: is a folder; name a file in it"),
    "below a file": (["-o", "OUT/room/cube.obj/a.mp4"], "cube.obj is a file, not a folder"),
    "chunk": (["-o", "OUT/a.mp4", "--chunk", "4"], "--chunk 4: expected at least 8, the frames"),
    "no chunk": (["-o", "OUT/a.mp4", "--chunks", "1"], "there is no chunk 1; the film has 0 to 0"),
    "still": (["-o", "OUT/a.png", "--chunks", "0"], "--chunks: has no effect on"),
    "codec": (["-o", "OUT/a.mp4", "--codec", "h264", "--size", "32", "16"], "has no libx264"),
}


@pytest.mark.parametrize(("words", "message"), BAD.values(), ids=BAD)
def test_bad_use_is_one_line(
    words: list[str],
    message: str,
    folder: Path,
    tmp_path: Path,
    fails: Fails,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "folder.mp4").mkdir()
    if "--codec" in words:
        monkeypatch.setattr(av, "Codec", lambda *_: (_ for _ in ()).throw(ValueError()))
    before = sorted(tmp_path.rglob("*"))
    line = fails("render", folder, *(word.replace("OUT", str(tmp_path)) for word in words))
    assert message in line
    assert sorted(tmp_path.rglob("*")) == before


def test_slow_videos_that_no_file_can_hold(tmp_path: Path, fails: Fails) -> None:
    folder = write_clip(tmp_path / "slow", fps=1e-6)
    line = fails("render", folder, "-o", tmp_path / "a.mp4")
    assert "1e-06 frames a second: video files hold 0.001 to 1000" in line


def test_strict_wants_all_frames(folder: Path, tmp_path: Path, fails: Fails) -> None:
    (folder / "color.0003.exr").unlink()
    line = fails("render", folder, "-o", tmp_path / "a.mp4", "--strict")
    assert "color.0003.exr" in line


def test_a_moved_scene_is_the_same(folder: Path, tmp_path: Path) -> None:
    """Its files keep their times."""
    before = fingerprint(Scene.open(folder))
    shutil.move(folder, tmp_path / "elsewhere")
    assert fingerprint(Scene.open(tmp_path / "elsewhere")) == before
    (tmp_path / "elsewhere" / "color.0002.exr").unlink()
    assert fingerprint(Scene.open(tmp_path / "elsewhere")) != before
