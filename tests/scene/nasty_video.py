"""Video files made to hurt, or to make FFmpeg read what they only name; see `nasty.py`."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from tests.footage.video.encoding import Track, grey16, plain, write_video
from tests.scene.nasty import CORPUS, Nasty, nasty, nasty_script

NO_VIDEO = "NumPy file, nor a video that can be read"
PLAYLIST = "#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{}\n#EXT-X-ENDLIST\n"

nasty("video", "v.mkv", "video that is empty", b"", "v.mkv: ")
nasty("video", "v.mkv", "video that is text", "format = 1\n" * 400, NO_VIDEO)
nasty("video", "v.mkv", "video of zeros", bytes(100_000), NO_VIDEO)
_Y4M = b"YUV4MPEG2 W%d H%d F30:1\n"
nasty("video", "v.y4m", "video of 10^10 pixels", _Y4M % (99999, 99999) + b"FRAME\n", "v.y4m: ")
nasty("video", "v.y4m", "video of no pixels", _Y4M % (0, 0) + b"FRAME\n", "v.y4m: ")
nasty("video", "v.y4m", "video of a long row", _Y4M % (20000, 2) + b"FRAME\n", "a side")
nasty("video", "v.y4m", "video without a frame", _Y4M % (64, 32), "v.y4m: ")
nasty("video", "v.y4m", "video of half a frame", _Y4M % (64, 32) + b"FRAME\nxx", "v.y4m: ")


def beside(path: Path) -> Path:
    """A right video next to a file."""
    pictures = [plain(90 + i, 64, 32) for i in range(24)]
    return write_video(path.parent / "other.ts", Track("libx264", "yuv420p", pictures))


for _name, _target in (
    ("a file beside it", "other.ts"),
    ("a file of the system", "/etc/passwd"),
    ("a page of the net", "http://127.0.0.1:9/v.ts"),
):

    def _playlist(path: Path, target: str = _target) -> None:
        beside(path)
        path.write_text(PLAYLIST.format(target))

    CORPUS.append(Nasty(f"playlist of {_name}", "video", "v.mkv", _playlist, NO_VIDEO))


@nasty_script("video", "v.mkv", NO_VIDEO)
def list_of_files_to_join(path: Path) -> None:
    beside(path)
    path.write_text("ffconcat version 1.0\nfile other.ts\n")


@nasty_script("video", "v.mp4", NO_VIDEO)
def manifest_of_segments(path: Path) -> None:
    beside(path)
    path.write_text(
        '<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011" type="static" '
        'mediaPresentationDuration="PT1S"><Period><AdaptationSet mimeType="video/mp2t">'
        '<Representation id="1" bandwidth="1"><BaseURL>other.ts</BaseURL>'
        "</Representation></AdaptationSet></Period></MPD>"
    )


@nasty_script("video", "v.mkv", NO_VIDEO)
def description_of_a_session(path: Path) -> None:
    path.write_text("v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\n"
                    "m=video 5004 RTP/AVP 96\na=rtpmap:96 H264/90000\n")  # fmt: skip


def matroska(path: Path) -> bytes:
    codes = np.random.default_rng(1).integers(0, 65536, (256, 512))
    write_video(path, grey16([codes] * 2))
    return path.read_bytes()


@nasty_script("video", "v.mkv", "more than 134217728 pixels")
def matroska_of_2_to_28_pixels(path: Path) -> None:
    # PixelWidth and PixelHeight, of two bytes each.
    small, large = b"\xb0\x82\2\0\xba\x82\1\0", b"\xb0\x82\x3f\xff\xba\x82\x3f\xff"
    data = matroska(path)
    assert small in data
    path.write_bytes(data.replace(small, large))


@nasty_script("video", "v.mkv", "v.mkv: ")
def matroska_cut_off_in_its_header(path: Path) -> None:
    path.write_bytes(matroska(path)[:300])


@nasty_script("video", "v.mkv", "v.mkv: ")
def matroska_whose_frames_are_noise(path: Path) -> None:
    data = bytearray(matroska(path))
    for at in range(700, len(data)):
        data[at] = (at * 2654435761 >> 7) & 255
    path.write_bytes(bytes(data))


@nasty_script("video", "v.avi", "v.avi: ")
def avi_of_10_to_9_pixels(path: Path) -> None:
    codes = np.zeros((32, 64), np.int64)
    write_video(path, Track("rawvideo", "gray", [[codes.astype(np.uint8)]]))
    data = path.read_bytes()
    small, large = struct.pack("<ii", 64, 32), struct.pack("<ii", 2**15, 2**15)
    path.write_bytes(data.replace(small, large))


@nasty_script("video", "v.mp4", "v.mp4: ")
def mp4_whose_boxes_are_16_exabytes(path: Path) -> None:
    write_video(path, Track("libx264", "yuv420p", [plain(90, 64, 32)] * 3))
    data = path.read_bytes()
    at = data.index(b"moov") - 4
    path.write_bytes(data[:at] + b"\0\0\0\1moov" + b"\xff" * 8 + data[at + 8 :])
