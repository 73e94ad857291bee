"""How rusticl is had: its library is made to look elsewhere, and what is missing is one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import rusticl

LIBRARY = b"\x7fELF\0/usr/lib/clc/spirv-mesa3d-.spv\0/usr/lib/clc/spirv64-mesa3d-.spv\0rest\0"


def test_its_builtins_may_be_elsewhere() -> None:
    """Both paths are replaced, and nothing moves."""
    changed = rusticl.with_builtins_in(LIBRARY, Path("out/clc"))
    words = [word for word in changed.split(b"\0") if word]
    assert words == [
        b"\x7fELF",
        b"out/clc/spirv-mesa3d-.spv",
        b"out/clc/spirv64-mesa3d-.spv",
        b"rest",
    ]
    for word in (b"out/clc/spirv64-mesa3d-.spv", b"rest"):
        place = LIBRARY.index(b"/usr/lib/clc/spirv64") if b"64" in word else LIBRARY.index(word)
        assert changed.index(word) == place
    assert len(changed) == len(LIBRARY)


def test_without_apt_it_is_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(rusticl, "FOLDER", tmp_path / "rusticl")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert rusticl.main([]) == 0
    assert capsys.readouterr().out == ("skipped: rusticl cannot be had here: there is no apt-get\n")
    assert list(tmp_path.iterdir()) == []
