"""How Mitsuba is found, and what is said when it is not."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.cli import main
from iprt.errors import DeviceError, IprtError
from iprt.truth import backend
from iprt.truth.denoise import denoise


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    backend.mitsuba.cache_clear()
    yield
    backend.mitsuba.cache_clear()


@pytest.fixture
def chart() -> Path:
    return Path(__file__).parents[2] / "scenes360" / "chart"


def test_without_mitsuba_one_line_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: Any, tmp_path: Path, chart: Path
) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    assert main(["reference", str(chart), "-o", str(tmp_path / "out.exr")]) == 2
    error = capsys.readouterr().err.strip()
    assert "\n" not in error
    assert "iprt[reference]" in error
    assert not list(tmp_path.iterdir())


def test_without_pyoidn_one_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    image = np.ones((4, 8, 3), np.float32)
    with pytest.raises(IprtError, match=r"iprt\[reference\]"):
        denoise(image, image, image, wrap=True)


@pytest.fixture
def stub(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A Mitsuba that only remembers its variant, and a probe that dies."""
    module = SimpleNamespace(chosen="")
    module.set_variant = lambda name: setattr(module, "chosen", name)
    module.variant = lambda: module.chosen
    monkeypatch.setitem(sys.modules, "mitsuba", module)
    aborted = subprocess.CompletedProcess([], -6, b"", b"LLVM ERROR")
    monkeypatch.setattr(backend.subprocess, "run", lambda *_, **__: aborted)
    return module


def test_an_aborting_llvm_falls_back_loudly(
    stub: SimpleNamespace, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger="iprt.truth"):
        backend.mitsuba()
    assert stub.chosen == "scalar_rgb"
    assert "LLVM >= 17" in caplog.text


@pytest.mark.usefixtures("stub")
def test_the_array_code_refuses_the_scalar_variant() -> None:
    with pytest.raises(DeviceError, match="llvm_ad_rgb"):
        backend.vector_mitsuba()


def test_the_newest_usable_llvm_is_taken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    names = ["libLLVM-14.so.1", "libLLVM.so.17.0", "libLLVM.so.19.1", "libLLVM-15.so"]
    for name in names:
        (tmp_path / name).touch()
    monkeypatch.setattr(backend, "_LLVM_PLACES", (f"{tmp_path}/libLLVM*.so*",))
    assert backend._newest_llvm() == tmp_path / "libLLVM.so.19.1"
    for name in names[1:3]:
        (tmp_path / name).unlink()
    assert backend._newest_llvm() is None


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["-o", "out.png"], "out.png"),
        (["-o", "out.exr", "--spp", "0"], "--spp 0"),
        (["-o", "out.exr", "--view", "nowhere"], "nowhere"),
    ],
)
def test_bad_arguments_are_one_line(
    arguments: list[str],
    named: str,
    chart: Path,
    capsys: Any,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["reference", str(chart), *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert named in error
    assert "\n" not in error


@pytest.mark.mitsuba
def test_an_unknown_model_is_one_line(chart: Path, capsys: Any, tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="needs the `reference` extra")
    out = str(tmp_path / "out.exr")
    assert main(["reference", str(chart), "-o", out, "--model", "no.such.model"]) == 2
    assert "--model no.such.model" in capsys.readouterr().err
