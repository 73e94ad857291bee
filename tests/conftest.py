"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zlib import crc32

import hypothesis
import pytest

from iprt import cli
from iprt.device import compilers
from iprt.device.choose import VARIABLE, choose_device
from iprt.device.compute import ComputeDevice
from iprt.settings.overrides import all_settings
from iprt.settings.user import variable
from tests.like_gpu import LikeGpu
from tests.scene.files import write_scene

DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")
"""Device of the tests; PoCL is the baseline."""

if "PYTEST_XDIST_WORKER" in os.environ:
    compilers.MOST_PROCESSES = 1  # other cores have tests of their own

# Examples may take long: other programs may run on all cores.
hypothesis.settings.register_profile(
    "any speed", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any speed")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let thorough tests be run in parts, as `.ci/run` does."""
    told = "of the thorough tests only the I-th of N parts"
    parser.addoption("--part", default="1/1", metavar="I/N", help=told)


@pytest.hookimpl(tryfirst=True)  # before -m counts
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark cases of products of parameters as thorough whose values other cases have too.

    And leave out the parts of the thorough ones that are not asked for.
    """
    cases: dict[str, list[Any]] = {}
    for item in items:
        if item.get_closest_marker("thorough") is None and hasattr(item, "callspec"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for functions in cases.values():
        for item, needed in zip(functions, _covering(functions), strict=True):
            if not needed:
                item.add_marker("thorough")
    part, parts = map(int, config.getoption("--part").split("/"))
    others = [
        item
        for item in items
        if item.get_closest_marker("thorough") is not None
        and crc32(item.nodeid.partition("[")[0].encode()) % parts != part - 1
    ]
    if others:
        config.hook.pytest_deselected(items=others)
        left_out = set(others)
        items[:] = [item for item in items if item not in left_out]


def _covering(functions: list[Any]) -> list[bool]:
    """Return which cases of a test together have every value of each parameter at least once.

    The last one, where lists of parameters are usually at their largest, and as few more as a
    greedy choice finds.
    """
    values = [_values(function) for function in functions]
    left = set().union(*values) - values[-1]
    chosen = [False] * (len(values) - 1) + [True]
    while left:
        best = max(range(len(values)), key=lambda index: len(values[index] & left))
        chosen[best] = True
        left -= values[best]
    return chosen


def _values(function: Any) -> set[tuple[object, ...]]:
    """Return what a case has of each list of parameters, and of each fixture that has some."""
    given = function.callspec.params
    lists = [mark.args[0] for mark in function.iter_markers("parametrize")]
    lists = [names.split(",") if isinstance(names, str) else names for names in lists]
    together = [tuple(name.strip() for name in names) for names in lists]
    alone = [(name,) for name in given.keys() - {name for names in together for name in names}]
    # Cases share the very objects.
    return {(names, *(id(given[name]) for name in names)) for names in (*together, *alone)}


@pytest.fixture(scope="session", autouse=True)
def _no_settings_of_the_user(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Hide the user's own settings from the tests."""
    for name in [*map(variable, all_settings()), VARIABLE]:
        os.environ.pop(name, None)
    os.environ["XDG_CONFIG_HOME"] = str(tmp_path_factory.mktemp("config"))
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(scope="session")
def device() -> ComputeDevice:
    """The device that the tests run on."""
    return ComputeDevice(choose_device(DEVICE))


@pytest.fixture(scope="session")
def gpu() -> LikeGpu:
    """Return the device treated as a GPU: with planes in half precision, for one."""
    return LikeGpu(choose_device(DEVICE))


@pytest.fixture
def own_accounts(device: ComputeDevice, monkeypatch: pytest.MonkeyPatch) -> ComputeDevice:
    """The device with no buffers accounted yet, for tests of which ones a renderer needs."""
    monkeypatch.setattr(device, "buffers", {})
    monkeypatch.setattr(device, "opengl", {})
    return device


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Folder of a small scene: a box room with a cube and a view."""
    return write_scene(tmp_path / "room")


@pytest.fixture
def fails(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a verb that must fail, and return its only line."""

    def run(*words: object, code: int = 2) -> str:
        assert cli.main([str(word) for word in words]) == code
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.startswith("iprt: error: ")
        assert captured.err.count("\n") == 1, captured.err
        return captured.err

    return run
