"""Clusters that cannot render: one line of advice before the first frame."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import iprt
from iprt import cli
from iprt.commands.cluster_progress import left_s
from iprt.errors import IprtError
from iprt.farm.cluster import connected, local_devices, scheduler_address
from iprt.farm.crew import Worker
from iprt.farm.examine import findings
from iprt.farm.order import Order
from iprt.scene.scene import Scene
from iprt.scene.scene_files import fingerprint
from tests.farm.cluster.efficiency import admitted, nothing
from tests.farm.cluster.machines import scheduler, words, worker

DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")
Render = Callable[..., tuple[int, list[str]]]


@pytest.fixture
def order(clip: Path, tmp_path: Path) -> Order:
    """An order whose token is `token`, which this machine can carry out."""
    (tmp_path / "token").touch()
    return Order(
        words=(),
        scene=str(clip),
        allow_outside=False,
        fingerprint=fingerprint(Scene.open(clip)),
        parts=str(tmp_path),
        device=DEVICE,
        space=1,
        version=iprt.__version__,
        topic="",
        patience_s=1.0,
    )


def test_a_worker_that_can_render_tells_its_device(order: Order) -> None:
    found = findings(order, "token")
    assert "problem" not in found
    assert (Path(order.parts) / found["mark"]).exists()
    assert found["device"]


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"version": "9.9"}, "has iprt 0.1.0, and 9.9 is asked for; install iprt 9.9 there"),
        ({"parts": "/nowhere/film.parts"}, "/nowhere/film.parts: is not the folder that it is"),
        ({"scene": "/nowhere/clip"}, "mount the scene's folder at the same path"),
        ({"fingerprint": "0"}, "holds other files than here, by size or time; share one folder"),
        ({"space": 1 << 60}, "MiB free; the chunks under way need about"),
        ({"device": "abacus"}, "no OpenCL device fits 'abacus'"),
    ],
)
def test_a_worker_that_cannot_render_tells_why(
    order: Order, changed: dict[str, object], told: str
) -> None:
    found = findings(replace(order, **changed), "token")
    assert told in found["problem"]
    assert "\n" not in found["problem"]


@pytest.mark.cluster
def test_a_cluster_none_of_whose_workers_can_render(
    render: Render, film: Path, tmp_path: Path
) -> None:
    """Require that nothing is rendered, and that the worker and its problem are named."""
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    file = tmp_path / "scheduler.json"
    with scheduler(file), worker(file, "a", PYTHONPATH="", IPRT_DEVICE="abacus"):
        code, said = render(file)
    assert code == 2
    assert said[0].startswith("worker a (tcp://127.0.0.1:")
    assert "is left out: IPRT_DEVICE='abacus': no OpenCL device fits" in said[0]
    assert said[-1].startswith("iprt: error: no worker of the cluster can render: worker a (tcp")
    assert not film.exists()


@pytest.mark.cluster
@pytest.mark.parametrize(
    ("where", "told"),
    [
        ("nowhere.json", "expected local, local:2, the address of a scheduler"),
        ("local:0", "expected 1 to 64 workers, such as local:2"),
        ("local:many", "expected 1 to 64 workers, such as local:2"),
        ("tcp://127.0.0.1:1", "no scheduler answers at tcp://127.0.0.1:1; start one"),
        ("{tmp}/scheduler.json", "is not a scheduler file of dask; write one: dask scheduler"),
    ],
)
def test_a_cluster_that_is_none(
    where: str, told: str, render: Render, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    monkeypatch.setattr("iprt.farm.cluster.CONNECT_S", 1.0)
    (tmp_path / "scheduler.json").write_text("{}")
    code, said = render(where.format(tmp=tmp_path))
    assert code == 2
    assert told in said[-1]
    assert said[-1].startswith("iprt: error: --cluster")
    if "tcp" not in where:
        assert list(tmp_path.iterdir()) == [tmp_path / "scheduler.json"], "nothing is left behind"


@pytest.mark.cluster
def test_files_that_are_seen_late_are_waited_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Delay files as network file systems do; files that never appear are rendered again."""
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    from iprt.farm.dispatch import Dispatch

    looks = dict.fromkeys(range(4), 0)

    def complete(chunk: int) -> bool:
        looks[chunk] += 1
        return chunk < 3 and looks[chunk] > 2

    monkeypatch.setattr("iprt.farm.dispatch.SETTLE_S", 1.0)
    order = Order((), "", False, "", str(tmp_path), None, 0, "", "seen late", 60.0)
    with connected(None, ["0:0"]) as client:
        dispatch = Dispatch(
            client, order, dict.fromkeys(looks, (1, 0)), complete, render=nothing, look=admitted
        )
        dispatch.run()
    assert dispatch.finished == {0, 1, 2}
    assert dispatch.failed[3].startswith("its files are not seen here (worker ")
    assert dispatch.done == 3
    assert len(caplog.records) == 3
    assert all("chunk 3 failed on worker" in one.getMessage() for one in caplog.records)
    assert not list(tmp_path.iterdir()), "the token is gone"


def test_without_the_extra(render: Render, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, said = render("local")
    assert code == 2
    assert said[-1].endswith("pip install 'iprt[cluster]'")


def test_flags_that_do_not_go_together(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(words(clip, tmp_path / "a.png", "local")) == 2
    assert "has no effect on" in capsys.readouterr().err
    film, profile = tmp_path / "film.mp4", f"--profile={tmp_path / 'p.json'}"
    assert cli.main(words(clip, film, "local", profile)) == 2
    assert "has no effect with --cluster" in capsys.readouterr().err


def test_workers_share_the_devices_of_this_machine() -> None:
    (only,) = set(local_devices("local:3", DEVICE))
    assert local_devices("local", only) == [only]
    assert local_devices("local:3", DEVICE) == [only] * 3
    assert scheduler_address("local") is None
    with pytest.raises(IprtError, match="expected local"):
        scheduler_address("locally")


def test_frames_that_were_there_before_count_for_no_worker() -> None:
    one = Worker("tcp://a", "a", "free")
    one.begin(3, None)
    for done in (2, 2, 3, 8):
        one.advance(done)
    assert one.frames == 6
    one.end()
    one.begin(4, None)
    one.advance(0)
    one.advance(4)
    assert one.frames == 10
    assert one.since is not None
    one.since -= 5.0
    assert left_s(20, [one]) == pytest.approx(10.0, rel=0.2)
    assert left_s(10, []) is None
