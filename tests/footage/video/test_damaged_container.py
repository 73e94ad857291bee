"""Video files that are damaged, cut off, or none."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from iprt.errors import FormatError, SceneError
from iprt.footage.video.container import video_streams
from iprt.footage.video.reader import open_streams
from tests.footage.video.counting import ALONE, color_track, depths, scene, told
from tests.footage.video.encoding import Track, grey16, write_video


def damaged(path: Path, which: list[int]) -> None:
    """Overwrite most of some packets of the first video stream."""
    with av.open(str(path)) as container:
        packets = [(p.pos, p.size) for p in container.demux(container.streams.video[0]) if p.size]
    data = bytearray(path.read_bytes())
    for index in which:
        at, size = packets[index]
        start = data.index(path.read_bytes()[at : at + 1], at)
        data[start + size // 3 : start + size] = b"\xff" * (size - size // 3)
    path.write_bytes(bytes(data))


def noise(frames: int) -> list[np.ndarray]:
    """Depth that does not compress, a level for each frame, the same in the first texel."""
    rng = np.random.default_rng(2)
    made = [rng.integers(2000, 60000, (32, 64)) for _ in range(frames)]
    for index, codes in enumerate(made):
        codes[:2] = 1000 + 10 * index
    return made


def test_damaged_depth_is_an_incident(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_video(tmp_path / "d.mkv", grey16(noise(8), options=ALONE))
    write_video(tmp_path / "c.mkv", color_track(8))
    damaged(tmp_path / "d.mkv", [3, 4])
    found = scene(tmp_path, 'color = "c.mkv"\ndepth = "d.mkv"\ndepth_scale = 0.001')
    assert told(found) == [(i, {3: 2, 4: 2}.get(i, i)) for i in range(8)]
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 2
    assert lines[0].endswith(
        "the frame at 0.100 s is damaged; depth of frame 2 stays until one is good"
    )
    assert lines[1] == "frame 5: good again, after 2 bad frames"
    with (
        pytest.raises(FormatError, match=r"d\.mkv: the frame at 0\.100 s is damaged"),
        found.stream(range(8), strict=True) as frames,
    ):
        list(frames)


@pytest.mark.parametrize(("every", "bad"), [(1, [3]), (6, [3, 4, 5])])
@pytest.mark.parametrize("order", [range(8), range(7, -1, -1), [3], [7, 3, 5]], ids=str)
def test_damage_hides_frames_up_to_the_next_key_frame(
    order: Sequence[int], every: int, bad: list[int], tmp_path: Path
) -> None:
    """FFV1's frames carry the statistics of its coder on: later ones decode to noise."""
    write_video(tmp_path / "d.mkv", grey16(noise(8), options=ALONE | {"g": str(every)}))
    damaged(tmp_path / "d.mkv", [3])
    (info,) = video_streams(tmp_path / "d.mkv")
    with open_streams() as streams:
        for index in order:
            time = Fraction(index, 30)
            if index in bad:
                with pytest.raises(FormatError, match="damaged"):
                    streams(info).at(time)
            else:
                assert streams(info).at(time).to_ndarray()[0, 0] == 1000 + 10 * index


@pytest.mark.parametrize("file", ["v.mkv", "v.ts", "v.avi"])
def test_a_file_that_is_cut_off_goes_on_with_its_last_frame(file: str, tmp_path: Path) -> None:
    path = write_video(tmp_path / file, grey16(noise(20)) if file != "v.ts" else color_track(20))
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
    (info,) = video_streams(path)
    left = round((info.last - info.start) * 30) + 1
    assert 5 < left < 20
    with open_streams() as streams:
        reader = streams(info)
        good = 0
        for index in range(left + 3):
            with suppress(FormatError):
                reader.at(info.start + Fraction(index, 30))
                good += 1
        assert good >= left - 1


def test_a_cut_off_mp4_is_one_line(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mp4", color_track())
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(SceneError) as error:
        scene(tmp_path, 'color = "v.mp4"\ndepth_scale = 0.001')
    assert "video.color: " in str(error.value)
    assert "PFM or NumPy file, nor a video that can be read" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("video", "message"),
    [
        ('color = "c.mkv"\ndepth_scale = 1', "c.mkv holds no depth: no second stream of 16-bit"),
        ('color = "c.mkv"\ndepth = "d.mkv"', "video.depth_scale: d.mkv stores integers"),
        ('color = "c.mkv"\ndepth = "c.mkv"\ndepth_scale = 1', "holds yuv420p; depth needs"),
        ('color = "c.mkv"\ndepth = "x.mkv"\ndepth_scale = 1', "depth: there is no file x.mkv"),
        ('color = "x.mkv"\ndepth = "d.mkv"\ndepth_scale = 1', "color: there is no file x.mkv"),
        ('color = "c.mkv"\ndepth = "t.txt"\ndepth_scale = 1', "t.txt: not an EXR, PNG, JPEG"),
        ('color = "x.mkv"\ndepth_scale = 1', "video.color: there is no file x.mkv"),
        ('color = "c.png"\ndepth_scale = 1', "video.depth: required key is missing"),
        ('color = "d.mkv"\ndepth = "d.mkv"\ndepth_range = [1, 1]', "two depths that differ"),
        ('color = "c.mkv"\ndepth = "d.mkv"\ndepth_range = [1, 2]\ndepth_scale = 1', "one of them"),
        ('color = "c.mkv"\ndepth = "d.mkv"\ndepth_encoding = "inverse"', "no effect without"),
        ('color = "a.mka"\ndepth = "d.mkv"\ndepth_scale = 1', "a.mka: holds no video stream"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_video_is_one_line(video: str, message: str, tmp_path: Path) -> None:
    write_video(tmp_path / "c.mkv", color_track(2))
    write_video(tmp_path / "d.mkv", grey16(depths(2)))
    (tmp_path / "t.txt").write_text("some text\n" * 50)
    with av.open(str(tmp_path / "a.mka"), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000, layout="mono")
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), layout="mono")
        sound.sample_rate = 8000
        container.mux(stream.encode(sound))
    with pytest.raises(SceneError) as error:
        scene(tmp_path, video)
    lines = str(error.value).splitlines()
    assert sum(message in line for line in lines) == 1, str(error.value)


def test_sizes_are_told(tmp_path: Path) -> None:
    write_video(tmp_path / "c.mkv", color_track(2))
    write_video(tmp_path / "d.mkv", grey16([np.full((64, 64), 5)] * 2))
    found = scene(tmp_path, 'color = "c.mkv"\ndepth = "d.mkv"\ndepth_scale = 1')
    with pytest.raises(FormatError, match=r"d\.mkv: 64 x 64 pixels, but color has 64 x 32"):
        found.frame()
    tall = [[np.full((48, 64), 90, np.uint8), *[np.full((24, 32), 128, np.uint8)] * 2]]
    write_video(tmp_path / "c.mkv", Track("ffv1", "yuv420p", tall))
    found = scene(tmp_path, 'color = "c.mkv"\ndepth = "d.mkv"\ndepth_scale = 1')
    with pytest.raises(FormatError, match="64 x 48 pixels; an equirect panorama is twice"):
        found.frame()
