"""The doctor: probes survive what they probe, and every lack comes with a command."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from iprt.commands import installation
from iprt.commands.doctor import show
from iprt.commands.probe import probe, read_record
from iprt.device.choose import DeviceInfo, select
from iprt.device.icd import read_vendors, write_vendors
from iprt.device.install import requirements
from iprt.errors import DeviceError

ROOT = Path(__file__).parents[2]
DEVICE: dict[str, Any] = {
    "index": "0:0",
    "name": "processor",
    "platform": "Portable Computing Language",
    "vendor": "The pocl project",
    "version": "OpenCL 3.0",
    "driver": "3.1",
    "kind": "cpu",
    "memory_mib": 4096,
    "compute_units": 2,
    "discrete": False,
    "problem": "",
}
OPENCL: dict[str, Any] = {"devices": [DEVICE], "chosen": "0:0", "reason": "the only one"}
WORKING: dict[str, dict[str, Any]] = {
    "opencl": OPENCL,
    "opengl": {"found": "GPU, 4.6", "software": False},
    "window": {"found": "works"},
    "browser": {"found": "works"},
    "mitsuba": {"found": "llvm_ad_rgb"},
}
CACHES = {"folder": "/home/me/.cache", "problem": ""}


@pytest.fixture
def examine(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What `examine` finds where probes say this, and all packages but some are installed."""

    def report(lacking: tuple[str, ...] = (), **records: dict[str, Any]) -> dict[str, Any]:
        monkeypatch.setattr(
            installation, "installed", lambda name: None if name in lacking else "1.0"
        )
        found = WORKING | records
        monkeypatch.setattr(installation, "probe", lambda name, *_: found[name])
        return installation.examine()

    return report


def lacking(report: dict[str, Any]) -> dict[str, str]:
    return {part["name"]: part["error"] for part in report["parts"] if "error" in part}


def shown(report: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> str:
    show(report)
    return capsys.readouterr().out


def test_a_healthy_machine(examine: Any, capsys: pytest.CaptureFixture[str]) -> None:
    report = examine()
    assert report["ok"]
    assert lacking(report).keys() <= {"intel-opencl-rt"}
    text = shown(report | {"caches": CACHES}, capsys)
    assert "chosen: 0:0, the only one" in text
    assert "compiled kernels are kept in /home/me/.cache" in text
    assert "scipy 1.0" in text
    assert text.endswith("ready to render\n")


def test_without_a_device_nothing_renders(examine: Any, capsys: pytest.CaptureFixture[str]) -> None:
    error = "no OpenCL device: install a driver with `apt-get install pocl`"
    report = examine(opencl={"error": error})
    assert not report["ok"]
    text = shown(report, capsys)
    assert f"OpenCL: {error}" in text
    assert text.endswith("cannot render\n")


def test_opengl_is_not_required(examine: Any, capsys: pytest.CaptureFixture[str]) -> None:
    report = examine(opengl={"error": "no libEGL"})
    assert report["ok"]
    assert lacking(report)["OpenGL through EGL"] == "no libEGL"
    assert "no libEGL" in shown(report, capsys)
    software = examine(opengl={"found": "llvmpipe", "software": True})
    assert "OpenGL runs on the processor" in shown(software, capsys)


def test_a_device_that_is_not_chosen_does_not_render(examine: Any) -> None:
    assert not examine(opencl={"devices": [DEVICE], "error": "PYOPENCL_CTX='x'"})["ok"]


def test_a_driver_that_cannot_be_used_is_no_driver() -> None:
    info = DeviceInfo(**DEVICE | {"problem": "its LLVM is too old"})
    assert info.plain() == DEVICE | {"problem": "its LLVM is too old"}
    with pytest.raises(DeviceError, match="pip install"):  # apt's PoCL may be what fails
        select(None, [info])


def test_a_missing_dependency_is_named_with_its_command(
    examine: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    report = examine(("scipy", "flip-evaluator"))
    assert not report["ok"]
    command = f"`{sys.executable} -m pip install '{requirements()['scipy']}'`"
    assert lacking(report)["scipy"] == f"not installed; {command}"
    assert command in shown(report, capsys)
    assert f"`{sys.executable} -m pip install flip-evaluator`" in lacking(report)["flip-evaluator"]
    assert examine(("flip-evaluator",))["ok"]


def test_intels_runtime_is_offered_on_its_processors_only(
    examine: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(installation, "intel_runtime", lambda: None)
    for machine, offered in (("x86_64", True), ("aarch64", False)):
        monkeypatch.setattr("platform.machine", lambda machine=machine: machine)
        assert ("intel-opencl-rt" in lacking(examine())) == offered


def test_requirements_are_those_of_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = [requirement.partition(">=")[0].lower() for requirement in project["dependencies"]]
    assert sorted(map(str.lower, requirements())) == sorted(named)
    extra = project["optional-dependencies"]["reference"]
    assert sorted(requirements("reference").values()) == sorted(extra)


@pytest.mark.parametrize(
    ("status", "stdout", "stderr", "error"),
    [
        (-11, '{"renderer": "x"}\n', "", "the process was ended by SIGSEGV"),
        (
            1,
            "",
            "Traceback\nImportError: libX\n",
            "the process ended with status 1: ImportError: libX",
        ),
        (0, "", "", "the process ended with status 0: no output"),
        (0, "driver chatter\n", "", "the process ended with status 0: no output"),
    ],
)
def test_a_dying_child_becomes_an_error(status: int, stdout: str, stderr: str, error: str) -> None:
    assert read_record(status, stdout, stderr) == {"error": error}


def test_chatter_before_the_record_is_ignored() -> None:
    assert read_record(0, 'chatter\n{"a": 1}\n', "warning") == {"a": 1}


def test_a_hanging_child_becomes_an_error() -> None:
    assert probe("opencl", timeout_s=0.001) == {"error": "no answer within 0 s"}


def test_a_child_that_cannot_be_started_becomes_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/proc/none")
    assert probe("opencl")["error"].startswith("no process can be started: ")


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_driver_that_crashes_is_told_from_those_that_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A driver that ends the process that loads it, beside those of this machine."""
    source, library = tmp_path / "bad.c", tmp_path / "libbad.so"
    source.write_text("#include <stdlib.h>\n__attribute__((constructor)) void f(void) { abort(); }")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True)
    working = read_vendors(installation.vendors_folder())
    vendors = write_vendors({**working, "bad.icd": str(library)}, tmp_path)
    monkeypatch.setenv("OCL_ICD_VENDORS", str(vendors))
    report = installation.examine()
    crash = "the process was ended by SIGABRT"
    assert not report["ok"]
    assert report["opencl"]["error"] == crash
    assert report["opencl"]["vendors"] == str(vendors)
    alone = dict(report["opencl"]["alone"])
    text = shown(report, capsys)
    assert all(f"{library} alone: {found}" in text for library, found in alone.items())
    assert alone.pop(str(library)) == crash
    assert any("ended" not in found for found in alone.values())


@pytest.mark.thorough
def test_json_of_this_machine() -> None:
    """The real command, as a program reads it."""
    result = subprocess.run(
        [sys.executable, "-m", "iprt", "doctor", "--json"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    report = json.loads(result.stdout)
    assert result.returncode == (0 if report["ok"] else 3)
    assert set(report) == {"ok", "opencl", "caches", "versions", "parts"}
    devices = report["opencl"]["devices"]
    assert set(devices[0]) == set(DEVICE)
    assert report["opencl"]["chosen"] in [device["index"] for device in devices]
    assert report["versions"]["numpy"]
    for part in report["parts"]:
        assert ("found" in part) != ("error" in part), part


def test_names_with_brackets_are_shown_as_they_are(
    examine: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    report = examine(
        opencl=OPENCL | {"devices": [DEVICE | {"name": "[b]:x: [/]"}]}, opengl={"found": "[/G]"}
    )
    report["opencl"]["vendors"] = "/etc/[red]"
    text = shown(report | {"caches": {"folder": "/home/[i]me/.cache", "problem": ""}}, capsys)
    for name in ("[b]:x: [/]", "/etc/[red]", "/home/[i]me/.cache", "[/G]"):
        assert name in text


def test_a_cache_of_no_use_is_told(examine: Any, capsys: pytest.CaptureFixture[str]) -> None:
    caches = {"folder": "/tmp/x", "problem": "/home/me/.cache cannot be written"}
    text = shown(examine() | {"caches": caches}, capsys)
    assert "compiled kernels are not kept for the next run: /home/me/.cache cannot" in text


def without(module: str, viewer: str) -> str:
    """What the probe of a viewer says where a module cannot be imported and there is no display."""
    code = (
        f"import sys; sys.modules[{module!r}] = None; from iprt.commands import probe; probe.main()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, viewer],
        cwd=ROOT,
        env={name: value for name, value in os.environ.items() if "DISPLAY" not in name},
        capture_output=True,
        text=True,
        check=True,
    )
    return str(json.loads(result.stdout)["error"])


@pytest.mark.parametrize(
    ("viewer", "module"),
    [("window", "glfw"), ("window", "imgui_bundle"), ("browser", "viser")],
)
def test_what_a_viewer_lacks_comes_with_its_command(viewer: str, module: str) -> None:
    error = without(module, viewer)
    assert f"{module} is not installed" in error
    assert f"`{sys.executable} -m pip install " in error
    assert all(name in error for name in ("imgui-bundle>=", "glfw>=", "viser"))


def test_a_display_that_is_missing_is_told() -> None:
    pytest.importorskip("imgui_bundle")
    pytest.importorskip("glfw")
    error = without("viser", "window")
    assert error.startswith("no window can be opened (X11: ")
    assert error.endswith("in a browser: iprt view --web")
