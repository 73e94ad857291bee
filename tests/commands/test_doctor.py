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

from iprt.commands import installation as doctor
from iprt.commands.doctor import show
from iprt.commands.probe import probe, read_record
from iprt.device.icd import read_vendors, write_vendors

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
    "chosen": True,
}
OPENCL: dict[str, Any] = {
    "devices": [DEVICE],
    "chosen": "0:0",
    "reason": "the only one",
    "vendors": "/etc/OpenCL/vendors",
}
OPENGL: dict[str, Any] = {"renderer": "GPU", "vendor": "V", "version": "4.6", "software": False}
CACHES: dict[str, Any] = {"caches": {"folder": "/home/me/.cache", "problem": ""}}
VERSIONS: dict[str, str | None] = dict.fromkeys(("python", "iprt", *doctor.CORE), "1.0")


def diagnose(
    opencl: dict[str, Any],
    opengl: dict[str, Any],
    found: dict[str, str | None] = VERSIONS,
    **records: dict[str, Any],
) -> dict[str, Any]:
    viewers: dict[str, Any] = {"window": {}, "browser": {}}
    return doctor.diagnose({"opencl": opencl, "opengl": opengl} | viewers | records, found)


def lacking(report: dict[str, Any]) -> dict[str, str]:
    return {entry["what"]: entry["install"] for entry in report["missing"]}


def test_a_healthy_machine() -> None:
    report = diagnose(OPENCL, OPENGL)
    assert report["ok"]
    assert not {"OpenCL device", "OpenGL through EGL", *doctor.CORE} & lacking(report).keys()


def test_no_device_and_no_egl_come_with_commands() -> None:
    opencl = {"error": "no OpenCL device", "vendors": "/etc/OpenCL/vendors"}
    report = diagnose(opencl, {"error": "no libEGL"})
    assert not report["ok"]
    assert "install" in lacking(report)["OpenCL device"]
    assert lacking(report)["OpenGL through EGL"].endswith("libegl1 libgl1 libgl1-mesa-dri")


def test_opengl_is_not_required() -> None:
    report = diagnose(OPENCL, {"error": "no libEGL"})
    assert report["ok"]
    assert "OpenGL through EGL" in lacking(report)


def test_a_wrong_environment_is_no_missing_driver() -> None:
    opencl = {"devices": [DEVICE | {"chosen": False}], "error": "PYOPENCL_CTX='x'", "vendors": "/v"}
    report = diagnose(opencl, OPENGL)
    assert not report["ok"]
    assert "OpenCL device" not in lacking(report)


def test_a_driver_that_cannot_be_used_is_no_driver() -> None:
    opencl = OPENCL | {"devices": [DEVICE | {"problem": "its LLVM is too old"}], "error": "none"}
    report = diagnose(opencl, OPENGL)
    assert "pip install" in lacking(report)["OpenCL device"]  # apt's PoCL may be what fails


def test_a_missing_dependency_is_named_with_its_command() -> None:
    report = diagnose(OPENCL, OPENGL, VERSIONS | {"scipy": None})
    assert not report["ok"]
    assert lacking(report)["scipy"] == f"{sys.executable} -m pip install scipy"


@pytest.mark.parametrize(
    ("mitsuba", "wanted"),
    [
        ({"variant": "llvm_ad_rgb", "llvm": "/usr/lib/libLLVM.so.19.1"}, False),
        ({"variant": "scalar_rgb", "llvm": None}, True),
        ({"error": "the process was ended by SIGABRT"}, True),
    ],
)
def test_llvm_is_wanted_where_mitsuba_runs_without(mitsuba: dict[str, Any], wanted: bool) -> None:
    report = diagnose(OPENCL, OPENGL, mitsuba=mitsuba)
    assert ("LLVM >= 17" in lacking(report)) == wanted
    assert report["ok"]


def test_intels_runtime_is_offered_on_its_processors_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "intel_runtime", lambda: None)
    for machine, offered in (("x86_64", True), ("aarch64", False)):
        monkeypatch.setattr("platform.machine", lambda machine=machine: machine)
        report = diagnose(OPENCL, OPENGL)
        assert ("intel-opencl-rt" in lacking(report)) == offered


def test_core_packages_are_those_of_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = [requirement.partition(">=")[0] for requirement in project["dependencies"]]
    assert sorted(named) == sorted(doctor.CORE)


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
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A driver that ends the process that loads it, beside those of this machine."""
    source, library = tmp_path / "bad.c", tmp_path / "libbad.so"
    source.write_text("#include <stdlib.h>\n__attribute__((constructor)) void f(void) { abort(); }")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True)
    working = read_vendors(Path(doctor.vendors_folder()))
    vendors = write_vendors({**working, "bad.icd": str(library)}, tmp_path)
    together = probe("opencl", variables={"OCL_ICD_VENDORS": str(vendors)})
    assert together == {"error": "the process was ended by SIGABRT"}
    alone = doctor.drivers_alone(vendors)
    assert alone.pop(str(library)) == together
    assert any(record.get("devices") for record in alone.values())
    report = diagnose(together | {"alone": alone, "vendors": str(vendors)}, OPENGL)
    assert not report["ok"]
    assert "OpenCL device" not in lacking(report)
    show(report | CACHES)
    text = capsys.readouterr().out
    for name in alone:
        assert f"{name} alone: " in text


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
    assert set(report) == {
        "ok",
        "opencl",
        "opengl",
        "caches",
        "versions",
        "optional",
        "missing",
    }
    assert set(report["opencl"]["devices"][0]) == set(DEVICE)
    assert [d["index"] for d in report["opencl"]["devices"] if d["chosen"]] == [
        report["opencl"]["chosen"]
    ]
    assert set(report["opengl"]) == set(OPENGL)
    assert report["versions"]["numpy"]
    for part in report["optional"]:
        assert set(part) == {"name", "purpose", "version", "state"}
    for entry in report["missing"]:
        assert set(entry) == {"what", "why", "install"}


def test_the_tables_show_the_choice_and_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    show(diagnose(OPENCL, OPENGL | {"software": True}, VERSIONS | {"tyro": None}) | CACHES)
    text = capsys.readouterr().out
    assert "chosen: 0:0, the only one" in text
    assert "OpenGL runs on the processor" in text
    assert "compiled kernels are kept in /home/me/.cache" in text
    assert f"{sys.executable} -m pip install tyro" in text
    assert "cannot render" in text


def test_names_with_brackets_are_shown_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    opencl = OPENCL | {"devices": [DEVICE | {"name": "[b]:x: [/]"}], "vendors": "/etc/[red]"}
    caches = {"folder": "/home/[i]me/.cache", "problem": ""}
    show(diagnose(opencl, OPENGL | {"renderer": "[/G]"}) | {"caches": caches})
    text = capsys.readouterr().out
    for name in ("[b]:x: [/]", "/etc/[red]", "/home/[i]me/.cache", "[/G]"):
        assert name in text


def test_a_cache_of_no_use_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    caches = {"folder": "/tmp/x", "problem": "/home/me/.cache cannot be written"}
    show(diagnose(OPENCL, OPENGL) | {"caches": caches})
    text = capsys.readouterr().out
    assert "compiled kernels are not kept for the next run: /home/me/.cache cannot" in text


def without(module: str, viewer: str) -> dict[str, Any]:
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
    record: dict[str, Any] = json.loads(result.stdout)
    return record


@pytest.mark.parametrize(
    ("viewer", "module"),
    [("window", "glfw"), ("window", "imgui_bundle"), ("browser", "viser")],
)
def test_what_a_viewer_lacks_comes_with_its_command(viewer: str, module: str) -> None:
    record = without(module, viewer)
    assert f"{module} is not installed" in record["error"]
    report = diagnose(OPENCL, OPENGL, **{viewer: record})
    command = lacking(report)[{"window": "iprt view", "browser": "iprt view --web"}[viewer]]
    assert command.startswith(f"{sys.executable} -m pip install ")
    assert all(name in command for name in ("imgui-bundle>=", "glfw>=", "viser"))


def test_a_display_that_is_missing_is_told() -> None:
    pytest.importorskip("imgui_bundle")
    pytest.importorskip("glfw")
    record = without("viser", "window")
    assert record["error"].startswith("no window can be opened (X11: ")
    assert record["error"].endswith("in a browser: iprt view --web")
    report = diagnose(OPENCL, OPENGL, window=record)
    (part,) = (part for part in report["optional"] if part["name"] == "iprt view")
    assert part["state"] == record["error"]
    assert "iprt view" not in lacking(report)
