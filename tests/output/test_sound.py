"""Sound of films: the source's clicks are heard, unchanged, when the pictures flash.

`film` joins pieces as a render does; its pictures flash when the source's do.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from iprt.errors import FormatError
from iprt.output import sound as module
from iprt.output.encode import FORMATS, encode_piece, join_pieces
from iprt.output.film_output import FilmOutput
from iprt.output.sound import Sound
from iprt.renderer import RenderedFrame
from tests.output.films import opened, plan
from tests.sounding import (
    CLICKS,
    FPS,
    HEIGHT,
    WIDTH,
    clicks_in,
    flash_luma,
    flashes,
    sound_bytes,
    sound_codecs,
    write_sounding,
)

WHOLE, CUT, STEPS = range(40), range(11, 33), range(4, 34, 2)
"""Numbers of the source's frames. The cut begins within a packet of sound."""
TOLERANCE_S = 0.003
LENGTH_S = 2.0


def film(
    source: Path,
    suffix: str = ".mp4",
    frames: range = WHOLE,
    *,
    zero: Fraction = Fraction(0),
    additions: dict[bytes, bytes] | None = None,
    clicks: tuple[float, ...] = CLICKS,
) -> Path:
    """Write a film of some frames of a source whose first frame is shown at `zero`."""
    rate = Fraction(FPS, frames.step)
    pieces = []
    for first in range(0, len(frames), 8):
        piece = source.with_name(f"{first}.mp4")
        lumas = [flash_luma(index / FPS, clicks) for index in frames[first : first + 8]]
        pictures = (np.full((HEIGHT * 3 // 2, WIDTH), luma, np.uint8) for luma in lumas)
        encode_piece(piece, pictures, codec="h264", rate=rate)
        pieces.append((first, piece))
    path = source.with_name(f"film{suffix}")
    sound = Sound(source, zero + Fraction(frames[0], FPS), len(frames) / rate)
    join_pieces(path, pieces, rate=rate, comment="", additions=additions, sound=sound)
    return path


def require_together(path: Path, clicks: int = len(CLICKS)) -> None:
    """Require pictures from 0 on, and `clicks` flashes with a click at each."""
    with av.open(str(path)) as container:
        assert next(container.decode(video=0)).time == 0.0
    shown, heard = flashes(path), clicks_in(path)
    assert len(shown) == len(heard) == clicks, (shown, heard)
    assert np.abs(np.subtract(shown, heard)).max() < TOLERANCE_S, (shown, heard)


def require_length(path: Path, seconds: float, late: float = 0.022) -> None:
    """Require pictures to end with the film, and sound at most `late` seconds later."""
    with av.open(str(path)) as container:
        ends = [frame.time + frame.samples / frame.rate for frame in container.decode(audio=0)]
        assert abs(container.duration / av.time_base - seconds) < 0.01
    assert max(ends) < seconds + late


@pytest.mark.parametrize("frames", [WHOLE, CUT, STEPS], ids=["whole", "cut", "steps"])
@pytest.mark.parametrize("suffix", FORMATS)
def test_packets_are_copied_to_their_pictures(suffix: str, frames: range, tmp_path: Path) -> None:
    source = write_sounding(tmp_path / "source.mp4")
    path = film(source, suffix, frames)
    clicks = 2 if frames is CUT else 3
    require_together(path, clicks)
    require_length(path, len(frames) * frames.step / FPS, 0.55 * 1024 / 48_000)
    copied, there = sound_bytes(path), sound_bytes(source)
    count = len(copied)
    assert copied in [there[first : first + count] for first in range(len(there) - count + 1)]
    if frames is WHOLE and suffix != ".mkv":
        assert copied == there
    assert {each.name for each in tmp_path.glob("film*")} == {path.name}


@pytest.mark.parametrize(
    ("source", "codec", "suffix", "expected"),
    [
        ("a.mkv", "libopus", ".mp4", "opus"),
        ("a.mkv", "libopus", ".mov", "aac"),
        ("a.mkv", "libopus", ".mkv", "opus"),
        ("a.mkv", "libmp3lame", ".mp4", "mp3"),
        ("a.mov", "pcm_s16le", ".mp4", "aac"),
        ("a.mov", "pcm_s16le", ".mov", "pcm_s16le"),
        ("a.avi", "pcm_s16le", ".mp4", "aac"),
        ("a.mkv", "flac", ".mp4", "flac"),
        ("a.mkv", "flac", ".mov", "aac"),
        ("a.mkv", "flac", ".mkv", "flac"),
    ],
)
def test_codecs_that_a_container_does_not_take_are_others(
    source: str, codec: str, suffix: str, expected: str, tmp_path: Path
) -> None:
    write_sounding(tmp_path / source, codec)
    for frames, clicks in ((WHOLE, 3), (CUT, 2), (STEPS, 3)):
        path = film(tmp_path / source, suffix, frames)
        assert sound_codecs(path) == [expected]
        require_together(path, clicks)
        late = 0.05 if (suffix, expected) == (".mp4", "flac") else 0.022
        require_length(path, len(frames) * frames.step / FPS, late)


@pytest.mark.parametrize("codec", ["aac", "libopus"])
def test_the_first_sample_of_a_cut_is_heard(codec: str, tmp_path: Path) -> None:
    """Decoders get the packets before the cut, and players leave them out."""
    clicks = (0.25, 0.75)
    source = write_sounding(tmp_path / "source.mp4", codec, clicks=clicks)
    path = film(source, frames=range(5, 25), clicks=clicks)
    require_together(path, 2)
    assert clicks_in(path)[0] < 0.003


def test_matroska_keeps_what_its_codec_delay_hides(tmp_path: Path) -> None:
    """Opus begins 6.5 ms before its first audible sample."""
    clicks = (0.0, 0.5)
    source = write_sounding(tmp_path / "source.mkv", "libopus", clicks=clicks)
    path = film(source, ".mkv", clicks=clicks)
    require_together(path, 2)
    assert sound_bytes(path)[:90] == sound_bytes(source)[:90]


def test_a_rate_that_the_encoder_lacks(tmp_path: Path) -> None:
    source = write_sounding(tmp_path / "source.mov", "pcm_s16le", rate=37_800, layout="mono")
    require_together(film(source, ".mp4", CUT), 2)


def test_the_files_clock_need_not_start_at_0(tmp_path: Path) -> None:
    source = write_sounding(tmp_path / "source.ts")
    with av.open(str(source)) as container:
        stream = container.streams.video[0]
        zero = Fraction(stream.start_time) * stream.time_base
    assert zero > 0
    for suffix in FORMATS:
        require_together(film(source, suffix, CUT, zero=zero), 2)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("codec", ["aac", "flac"])
def test_sound_may_begin_late_and_end_early(codec: str, suffix: str, tmp_path: Path) -> None:
    source = write_sounding(tmp_path / "source.mkv", codec, begins=0.55, ends=1.0)
    path = film(source, suffix)
    (heard,) = clicks_in(path)
    assert abs(heard - 0.8) < TOLERANCE_S
    assert len(flashes(path)) == 3
    assert av_seconds(path) == pytest.approx(LENGTH_S, abs=0.03)


def av_seconds(path: Path) -> float:
    with av.open(str(path)) as container:
        return float(container.duration / av.time_base)


def test_a_film_beyond_the_sound_has_none(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    source = write_sounding(tmp_path / "source.mp4", ends=0.5)
    assert sound_codecs(film(source, frames=range(11, 30))) == [], "though it ends just before"
    assert not caplog.messages


def test_a_video_without_sound_stays_silent(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    source = tmp_path / "source.mp4"
    picture = np.full((HEIGHT * 3 // 2, WIDTH), 100, np.uint8)
    encode_piece(source, [picture] * 40, codec="h264", rate=Fraction(FPS))
    assert sound_codecs(film(source)) == []
    assert not caplog.messages


def test_of_several_streams_the_default_is_kept(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "iprt")
    source = write_sounding(tmp_path / "source.mkv", "aac", "flac", "aac")
    with av.open(str(source)) as container:
        defaults = ["default" in str(s.disposition).lower() for s in container.streams.audio]
    kept = (defaults.index(True) if True in defaults else 0) + 1
    path = film(source)
    assert len(clicks_in(path)) == 4 - kept
    (line,) = caplog.messages
    assert line == f"{source}: has 3 streams of sound; number {kept} is kept"


# Faults ------------------------------------------------------------------------------------------


def test_damage_is_silence_and_no_shift(tmp_path: Path) -> None:
    """The middle click lies in packets that cannot be decoded."""
    source = write_sounding(tmp_path / "source.mkv", "flac")
    packets = sound_bytes(source)
    data = source.read_bytes()
    place = round(0.8 * 48_000 / 4608)
    for packet in packets[place - 1 : place + 2]:
        data = data.replace(packet, b"\xff" * len(packet))
    source.write_bytes(data)
    assert clicks_in(film(source, ".mov")) == pytest.approx([0.3, 1.3], abs=TOLERANCE_S)


@pytest.mark.parametrize("suffix", FORMATS)
def test_sound_that_cannot_be_read_is_left_out(
    suffix: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    source = tmp_path / "source.mp4"
    source.write_bytes(b"no video at all")
    path = film(source, suffix)
    assert len(flashes(path)) == 3
    assert sound_codecs(path) == []
    (line,) = caplog.messages
    assert line.startswith(f"{source}: not an EXR")
    assert line.endswith("; the film is written without sound")


def test_sound_that_cannot_be_decoded_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    source = write_sounding(tmp_path / "source.mkv", "flac")
    data = source.read_bytes()
    for packet in sound_bytes(source):
        data = data.replace(packet, b"\xff" * len(packet))
    source.write_bytes(data)
    assert sound_codecs(film(source, ".mov")) == []
    (line,) = caplog.messages
    assert line == f"{source}: its sound is damaged; the film is written without sound"


def test_sound_that_the_container_refuses_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """FFmpeg's QuickTime muxer claims to take Opus, and then does not."""
    monkeypatch.setitem(module.COPIED, "mov", ("opus",))
    source = write_sounding(tmp_path / "source.mkv", "libopus")
    path = film(source, ".mov")
    assert len(flashes(path)) == 3
    assert sound_codecs(path) == []
    (line,) = caplog.messages
    assert line.startswith(f"{source}: its sound cannot be kept (")


def test_a_full_disk_does_not_cost_the_sound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("iprt.output.encode.sound_packets", full)
    with pytest.raises(FormatError, match=r"film\.mp4: cannot be written: No space left"):
        film(write_sounding(tmp_path / "source.mp4"))


# Films that grow ---------------------------------------------------------------------------------


def grown(path: Path, source: Path | None, stop: int | None = None) -> FilmOutput:
    """Write a film of the cut, or its part from a render stopped after `stop` frames."""
    sound = (
        None if source is None else Sound(source, Fraction(CUT[0], FPS), Fraction(len(CUT), FPS))
    )
    given = plan(CUT, there=range(CUT.stop), rate=Fraction(FPS), sound=sound)
    film = opened(path, given)
    for index in film.missing(0)[:stop]:
        color = np.full((HEIGHT, WIDTH, 3), flash_luma(index / FPS) / 255.0, np.float32)
        film.write(0, index, RenderedFrame(color, {}), "a device")
    if film.complete:
        film.finish()
    return film


def test_a_film_that_was_stopped_has_all_its_sound_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("iprt.output.movie.PIECE_S", 0.3)
    source = write_sounding(tmp_path / "source.mp4")
    path = tmp_path / "film.mp4"
    for frames in (9, 1):
        stopped = grown(path, source, frames)
        assert not path.exists()
        for piece in stopped.parts.path.glob("*.mp4"):
            assert sound_codecs(piece) == []
    grown(path, source)
    require_together(path, 2)
    grown(tmp_path / "whole.mp4", source)
    assert sound_bytes(path) == sound_bytes(tmp_path / "whole.mp4")


def test_a_finished_film_is_another_without_its_sound(tmp_path: Path) -> None:
    source = write_sounding(tmp_path / "source.mp4")
    path = tmp_path / "film.mp4"
    grown(path, source)
    assert grown(path, source, 0).complete
    assert not grown(path, None, 0).complete
    grown(path, None)
    assert sound_codecs(path) == []


def test_parts_go_with_and_without_sound(tmp_path: Path) -> None:
    source = write_sounding(tmp_path / "source.mp4")
    path = tmp_path / "film.mp4"
    grown(path, None, 9)
    grown(path, source)
    require_together(path, 2)
