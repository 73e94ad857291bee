"""Boxes of films with sound: the panorama's with the pictures, the ambisonic one with the sound."""

from __future__ import annotations

import struct
from pathlib import Path

import av
import pytest

from iprt.output.boxes import box, boxes_in
from iprt.output.spatial_media import equirect_boxes, track_box
from tests.output.test_boxes import TABLES
from tests.output.test_sound import CUT, film, require_together
from tests.sounding import sound_codecs, write_sounding


def tracks(data: bytes) -> dict[bytes, bytes]:
    """Return the boxes of tracks by the tracks' kind."""
    moov = next(each for each in boxes_in(data) if each.kind == b"moov")
    whole = [
        data[each.start : each.end]
        for each in boxes_in(data, moov.body, moov.end)
        if each.kind == b"trak"
    ]
    return {b"vide" if b"vide" in track else b"soun": track for track in whole}


AMBISONIC = box(b"SA3D", struct.pack(">BBIBBI4I", 0, 0, 1, 0, 0, 4, 0, 1, 2, 3))
"""First order, ACN, SN3D, four channels in their order."""


def with_ambisonics(path: Path) -> Path:
    """Return the file with that box in its sound's sample entry; its index comes last."""

    def added(data: bytes, start: int, end: int) -> bytes:
        whole = b""
        for each in boxes_in(data, start, end):
            inner = data[each.body : each.end]
            if each.kind in (b"mp4a", b"sowt"):
                inner += AMBISONIC
            elif each.kind == b"stsd":
                inner = inner[:8] + added(data, each.body + 8, each.end)
            elif each.kind in (b"moov", *TABLES):
                inner = added(data, each.body, each.end)
            whole += box(each.kind, inner)
        return whole

    data = path.read_bytes()
    path.write_bytes(added(data, 0, len(data)))
    return path


@pytest.mark.parametrize(
    ("name", "codec", "suffix", "expected"),
    [
        ("source.mp4", "aac", ".mp4", "aac"),
        ("source.mp4", "aac", ".mov", "aac"),
        ("source.mov", "pcm_s16le", ".mov", "pcm_s16le"),
        ("source.mov", "pcm_s16le", ".mp4", "aac"),
    ],
)
def test_sound_from_all_around_says_so(
    name: str, codec: str, suffix: str, expected: str, tmp_path: Path
) -> None:
    source = with_ambisonics(write_sounding(tmp_path / name, codec, layout="4.0"))
    path = film(source, suffix, CUT, additions=equirect_boxes())
    require_together(path, 2)
    assert sound_codecs(path) == [expected]
    with av.open(str(path)) as container:
        assert container.streams.audio[0].codec_context.channels == 4
    assert track_box(source, 0) == track_box(path, 0) == AMBISONIC
    assert AMBISONIC not in tracks(path.read_bytes())[b"vide"]


def test_other_files_have_no_such_box(tmp_path: Path) -> None:
    assert track_box(write_sounding(tmp_path / "a.mp4"), 0) == b""
    assert track_box(tmp_path / "a.mp4", 1) == b""
    assert track_box(write_sounding(tmp_path / "a.mkv"), 0) == b""
    data = with_ambisonics(tmp_path / "a.mp4").read_bytes()
    for length in range(data.index(b"moov"), len(data), 40):
        (tmp_path / "cut.mp4").write_bytes(data[:length])
        assert track_box(tmp_path / "cut.mp4", 0) == b""
    assert track_box(tmp_path / "missing.mp4", 0) == b""
