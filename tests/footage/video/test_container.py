"""Video files: each frame is the one whose time is nearest, however it is come by."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from iprt.footage.prepare.remarks import video_notices
from iprt.footage.video.container import video_streams
from iprt.footage.video.reader import open_streams
from tests.footage.video.counting import (
    B_FRAMES,
    FRAMES,
    color_track,
    colors,
    depths,
    luma,
    scene,
    told,
)
from tests.footage.video.encoding import Track, grey16, write_video


def number(frame: av.VideoFrame) -> int:
    """The number of a frame, by its luma."""
    pixels = frame.to_ndarray()
    value = float(np.asarray(pixels).reshape(-1)[: 32 * 64].mean())
    value = value / 4 if "10" in frame.format.name else value
    return round((value - 30) / 8)


CODECS = {
    "H.264 with B-frames in MP4": ("a.mp4", "libx264", "yuv420p", B_FRAMES),
    "H.264 with B-frames in Matroska": ("a.mkv", "libx264", "yuv420p", B_FRAMES),
    "H.264 with B-frames in a transport stream": ("a.ts", "libx264", "yuv420p", B_FRAMES),
    "H.264 with open groups": ("a.mkv", "libx264", "yuv420p",
                               B_FRAMES | {"x264-params": "open-gop=1"}),
    "HEVC of 10 bits": ("a.mp4", "libx265", "yuv420p10le",
                        {"x265-params": "log-level=none:keyint=10:bframes=3:qp=8"}),
    "AV1": ("a.mp4", "libsvtav1", "yuv420p", {"g": "10", "crf": "10"}),
    "VP9 in WebM": ("a.webm", "libvpx-vp9", "yuv420p", {"g": "10", "deadline": "realtime"}),
    "ProRes in QuickTime": ("a.mov", "prores_ks", "yuv422p10le", {}),
    "Motion JPEG in AVI": ("a.avi", "mjpeg", "yuvj420p", {"q": "2"}),
}  # fmt: skip


@pytest.fixture(scope="module")
def encoded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("encoded")
    return {
        name: write_video(
            folder / f"{i}-{file}", Track(codec, pixels, colors(pixels), options=options)
        )
        for i, (name, (file, codec, pixels, options)) in enumerate(CODECS.items())
    }


@pytest.mark.parametrize("name", CODECS)
def test_every_frame_is_found(name: str, encoded: dict[str, Path]) -> None:
    (info,) = video_streams(encoded[name])
    assert (info.width, info.height, info.rate) == (64, 32, 30)
    assert round((info.last - info.start) * 30) == FRAMES - 1
    with open_streams() as streams:
        reader = streams(info)
        ahead = [number(reader.at(info.start + Fraction(i, 30))) for i in range(FRAMES)]
        assert ahead == list(range(FRAMES))
        assert reader.seeks == 0, "reading in order seeks"
        wild = [int(i) for i in np.random.default_rng(1).integers(0, FRAMES, 20)]
        assert [number(reader.at(info.start + Fraction(i, 30))) for i in wild] == wild
        assert reader.seeks > 0
        assert reader is streams(info)


def test_jumps_far_ahead_seek(encoded: dict[str, Path]) -> None:
    (info,) = video_streams(encoded["H.264 with B-frames in MP4"])
    with open_streams() as streams:
        reader = streams(info)
        reader.at(info.start)
        assert number(reader.at(info.last)) == FRAMES - 1
        assert reader.seeks == 0, "not far enough"
        assert number(reader.at(info.last + 100)) == FRAMES - 1
        assert number(reader.at(info.start - 100)) == 0


@pytest.mark.parametrize("file", ["a.mkv", "a.mp4"])
def test_variable_rates_go_by_time(file: str, tmp_path: Path) -> None:
    """Times in sixtieths, with gaps; checked against the nearest of them by brute force."""
    times = [0, 1, 2, 5, 6, 11, 12, 13, 30, 31, 40, 44]
    path = write_video(
        tmp_path / file,
        Track("libx264", "yuv420p", colors("", len(times)), rate=60, times=times, options=B_FRAMES),
    )
    (info,) = video_streams(path)
    asked = [Fraction(i, 24) for i in range(19)]
    tick = Fraction(1, 1000)  # Matroska's times are whole milliseconds
    expected = []
    for time in asked:
        away = [abs(Fraction(t, 60) - time) for t in times]
        near = [i for i, distance in enumerate(away) if distance <= min(away) + tick]
        expected.append(near)
    with open_streams() as streams:
        ahead = [number(streams(info).at(info.start + time)) for time in asked]
    assert all(index in near for index, near in zip(ahead, expected, strict=True))
    with open_streams() as streams:
        reader = streams(info)
        back = [number(reader.at(info.start + time)) for time in reversed(asked)]
    assert back[::-1] == ahead, "the same, from whichever side"


def test_depth_in_a_second_stream(tmp_path: Path) -> None:
    write_video(tmp_path / "v.mkv", color_track(), grey16(depths()))
    found = scene(tmp_path, 'color = "v.mkv"\ndepth_scale = 0.001')
    assert found.source.size == (64, 32)
    assert found.frame_indices == range(FRAMES)
    assert found.source.fps == 30.0
    assert video_notices(found.source) == []
    assert told(found) == [(i, i) for i in range(FRAMES)]
    assert told(found, [7, 3, 20]) == [(7, 7), (3, 3), (20, 20)]
    assert found.frame(5).depth[3, 4] == pytest.approx(1.05)


def test_depth_stored_before_color(tmp_path: Path) -> None:
    write_video(tmp_path / "v.mkv", grey16(depths()), color_track())
    assert told(scene(tmp_path, 'color = "v.mkv"\ndepth_scale = 0.001'), [4]) == [(4, 4)]


def test_depth_in_a_second_file_of_another_kind(tmp_path: Path) -> None:
    write_video(tmp_path / "v.ts", color_track())
    write_video(tmp_path / "d.avi", grey16(depths()))
    found = scene(tmp_path, 'color = "v.ts"\ndepth = "d.avi"\ndepth_scale = 0.001')
    assert told(found) == [(i, i) for i in range(FRAMES)]


def test_sixteen_bits_of_depth_are_exact(tmp_path: Path) -> None:
    codes = np.random.default_rng(3).integers(1, 65536, (32, 64))
    write_video(tmp_path / "v.mkv", color_track(1), grey16([codes]))
    found = scene(tmp_path, 'color = "v.mkv"\ndepth_scale = 0.0001')
    assert np.array_equal(found.raw_frame().depth, codes.astype(np.float32) * np.float32(0.0001))


@pytest.mark.parametrize("encoding", ["linear", "inverse"])
@pytest.mark.parametrize("full", [False, True], ids=["limited", "full"])
@pytest.mark.parametrize("pixels", ["yuv420p", "yuv420p10le"])
def test_depth_below_color(pixels: str, full: bool, encoding: str, tmp_path: Path) -> None:
    """Stored by the formula that the manifest names, read back to what was stored."""
    bits = 10 if "10" in pixels else 8
    black, white = (0, 2**bits - 1) if full else (16 << (bits - 8), 235 << (bits - 8))
    depth = np.linspace(0.6, 9.5, 32 * 64).reshape(32, 64)
    low, high = 0.5, 10.0
    part = (depth - low) / (high - low)
    if encoding == "inverse":
        part = (1 / depth - 1 / low) / (1 / high - 1 / low)
    lower = np.rint(black + part * (white - black))
    kind = "<u2" if bits > 8 else np.uint8
    upper = np.full((32, 64), 100 << (bits - 8))
    chroma = np.full((32, 32), 128 << (bits - 8)).astype(kind)
    planes = [np.concatenate([upper, lower]).astype(kind), chroma, chroma]
    tags = {"color_range": 2 if full else 1}
    write_video(tmp_path / "v.mkv", Track("ffv1", pixels, [planes], tags=tags))
    found = scene(
        tmp_path, f'color = "v.mkv"\ndepth_range = [{low}, {high}]\ndepth_encoding = "{encoding}"'
    )
    assert found.source.size == (64, 32)
    frame = found.raw_frame()
    inverse = encoding == "inverse"
    found_at, stored_at = (1 / frame.depth, 1 / depth) if inverse else (frame.depth, depth)
    span = 1 / low - 1 / high if inverse else high - low
    assert np.abs(found_at - stored_at).max() <= 0.501 * span / (white - black)
    assert np.ptp(frame.color) < 1e-6
    coded = ((100 << (bits - 8)) - black) / (white - black)
    assert frame.color[0, 0, 0] == pytest.approx(((coded + 0.055) / 1.055) ** 2.4, rel=1e-3)


def test_black_is_no_surface(tmp_path: Path) -> None:
    codes = np.full((32, 64), 5)
    codes[3, 7] = 0
    write_video(tmp_path / "v.mkv", color_track(1), grey16([codes]))
    for unit in ("depth_scale = 0.001", "depth_range = [1, 5]"):
        depth = scene(tmp_path, f'color = "v.mkv"\n{unit}').raw_frame().depth
        assert depth[3, 7] == 0.0
        assert np.count_nonzero(depth) == depth.size - 1


def test_depth_of_half_the_rate_is_the_nearest_in_time(tmp_path: Path) -> None:
    write_video(tmp_path / "c.mp4", color_track())
    write_video(tmp_path / "d.mkv", grey16(depths(12), rate=15))
    found = scene(tmp_path, 'color = "c.mp4"\ndepth = "d.mkv"\ndepth_scale = 0.001')
    # Halfway between two, the earlier, though Matroska's times are whole milliseconds.
    assert told(found) == [(i, i // 2) for i in range(FRAMES)]
    (line,) = video_notices(found.source)
    assert line == (
        "video.depth: d.mkv has 15 frames per second, the video 30; the nearest in time are shown"
    )


def test_depth_that_ends_early_stays(tmp_path: Path) -> None:
    write_video(tmp_path / "c.mp4", color_track())
    write_video(tmp_path / "d.mkv", grey16(depths(10)))
    found = scene(tmp_path, 'color = "c.mp4"\ndepth = "d.mkv"\ndepth_scale = 0.001')
    assert told(found) == [(i, min(i, 9)) for i in range(FRAMES)]
    (line,) = video_notices(found.source)
    assert line.startswith("video.depth: d.mkv ends after 0.30 s, the video after 0.77 s")


def test_frames_and_rate_of_the_manifest(tmp_path: Path) -> None:
    write_video(tmp_path / "v.mkv", color_track(), grey16(depths()))
    found = scene(tmp_path, 'color = "v.mkv"\ndepth_scale = 0.001\nframes = [2, 6]\nfps = 15')
    assert told(found) == [(2 * i, 2 * i) for i in range(2, 7)]
    assert len(video_notices(found.source)) == 2
    found = scene(tmp_path, 'color = "v.mkv"\ndepth_scale = 0.001\nframes = [20, 30]')
    assert told(found)[-1] == (23, 23)
    assert all("its last frame stays" in line for line in video_notices(found.source))


def test_streams_of_a_file_share_its_clock(tmp_path: Path) -> None:
    """Depth that starts three frames later belongs to later frames of color."""
    write_video(tmp_path / "v.mkv", color_track(), grey16(depths(10), times=list(range(3, 13))))
    found = scene(tmp_path, 'color = "v.mkv"\ndepth_scale = 0.001\nframes = [0, 12]')
    assert told(found) == [(i, max(i - 3, 0)) for i in range(13)]


def test_a_sequence_of_color_with_a_file_of_depth(tmp_path: Path) -> None:
    from PIL import Image

    write_video(tmp_path / "d.mkv", grey16(depths(5), rate=10))
    for index in range(5):
        code = round((luma(index) - 16) / 219 * 255)
        Image.new("RGB", (64, 32), (code,) * 3).save(tmp_path / f"c.{index + 7}.jpg", quality=95)
    found = scene(
        tmp_path, 'color = "c.%d.jpg"\ndepth = "d.mkv"\ndepth_scale = 0.001\nframes = [7, 11]'
    )
    assert found.source.fps == 10.0, "of the only stream that has one"
    assert told(found) == [(i, i) for i in range(5)]
