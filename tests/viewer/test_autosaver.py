"""Viewers that end with unsaved edits, and the next ones, which get them."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from iprt.geometry.material import Material
from iprt.geometry.meshes import load_mesh
from iprt.scene.autosave import EDITS, Autosave
from iprt.scene.light_edits import LightEdit
from iprt.scene.manifest import AUTOSAVE_NAME
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.scene import Scene
from iprt.viewer import autosaver
from iprt.viewer.autosaver import Offer
from iprt.viewer.engine import Engine
from tests.scene.files import CUBE
from tests.waiting import run_python, until

PLASTIC = Material("plastic", (0.2, 0.5, 0.3), alpha=0.3)


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(autosaver, "INTERVAL_S", 0.02)


@contextmanager
def opened(scene: Scene) -> Iterator[Engine]:
    """An engine that renders nothing, once it has looked for edits of earlier ones."""

    def none() -> None:
        raise AssertionError("nobody asks for a picture")

    with Engine(Scene.open(scene.root), none) as engine:  # type: ignore[arg-type]
        until(lambda: engine.autosaver.looked)
        yield engine


def die(engine: Engine) -> None:
    """Leave everything as a killed process does: only the operating system frees the locks."""
    engine.autosaver._ended.set()
    engine.autosaver._thread.join()
    for folder in engine.autosaver._folders:
        folder._lock.close()
    engine.autosaver._folders.clear()
    engine.autosaver._abandoned = True


def kept(scene: Scene) -> list[Path]:
    return sorted((scene.root / AUTOSAVE_NAME).glob(f"*/{EDITS}"))


def offer(engine: Engine) -> Offer:
    until(lambda: engine.autosaver.offer is not None)
    assert engine.autosaver.offer is not None
    return engine.autosaver.offer


@pytest.fixture
def left(scene: Scene, tmp_path: Path) -> Scene:
    """A scene whose viewer was killed with edits of a cube, a new mesh and the light."""
    (tmp_path / "thing.obj").write_text(CUBE)
    mesh = load_mesh(tmp_path / "thing.obj")
    place = flat(np.diag([0.2, 0.2, 0.2, 1.0]))
    with opened(scene) as engine:
        engine.editor.paint({"cube": PLASTIC})
        engine.set_light(LightEdit(gloss="declared"))
        new = ObjectEdit("thing", place, None, mesh, tmp_path / "thing.obj")
        engine._shared.edit(lambda world: world.having(new))
        until(lambda: any('"thing' in path.read_text().replace("\\", "") for path in kept(scene)))
        die(engine)
    (tmp_path / "thing.obj").unlink()  # as uploads go with their viewer
    return scene


def test_edits_of_a_killed_viewer_are_restored_and_saved(left: Scene) -> None:
    """They are one step of undo; once they are saved, nothing is left of the autosave."""
    with opened(left) as engine:
        found = offer(engine)
        assert found.names == ("cube", "thing", "gloss")
        assert found.text.endswith(" were found: cube, thing, gloss.")
        engine.autosaver.restore()
        until(lambda: bool(engine.unsaved))
        assert engine.unsaved == ("cube", "thing", "gloss")
        assert engine.world.edit_of("cube").material == PLASTIC
        engine.undo()
        assert not engine.can_undo
        assert engine.unsaved == ()
        until(lambda: not kept(left))
        engine.redo()
        until(lambda: len(kept(left)) == 1)
        engine.save()
        until(lambda: not engine.unsaved)
    assert not (left.root / AUTOSAVE_NAME).exists()
    cube, thing = Scene.open(left.root).manifest.objects
    assert cube.material is not None
    assert cube.material.material() == PLASTIC
    assert (thing.name, thing.mesh) == ("thing", "meshes/thing.obj")


def test_restored_edits_outlive_the_next_death(left: Scene) -> None:
    with opened(left) as engine:
        offer(engine)
        engine.autosaver.restore()
        until(lambda: bool(engine.unsaved))
        engine.editor.remove(["cube"])
        until(lambda: engine.autosaver._kept == edits_of(engine))
        die(engine)
    assert len(kept(left)) == 1
    with opened(left) as engine:
        assert set(offer(engine).names) == {"cube", "thing", "gloss"}
        engine.autosaver.restore()
        until(lambda: bool(engine.unsaved))
        assert engine.world.edit_of("cube").removed


def edits_of(engine: Engine) -> autosaver.Edits:
    return autosaver.Edits(engine.world.edits, engine.world.light, engine.world.views)


def test_the_next_one_is_offered_after_one_is_discarded(left: Scene) -> None:
    with opened(left) as engine:
        newer = kept(left)
        engine.autosaver.postpone()
        engine.editor.remove(["cube"])
        until(lambda: len(kept(left)) == 2)
        die(engine)
    with opened(left) as engine:
        assert offer(engine).names == ("cube",)
        engine.autosaver.discard()
        until(lambda: engine.autosaver.offer is not None)
        assert kept(left) == newer
        assert offer(engine).names == ("cube", "thing", "gloss")
        engine.autosaver.discard()
        until(lambda: engine.autosaver.looked)
        assert engine.autosaver.offer is None
    assert not (left.root / AUTOSAVE_NAME).exists()


def test_two_viewers_of_one_scene(scene: Scene) -> None:
    """Neither is offered what the other one has; an end without an answer keeps the edits."""
    with opened(scene) as one:
        one.editor.remove(["cube"])
        until(lambda: len(kept(scene)) == 1)
        with opened(scene) as other:
            assert other.autosaver.offer is None
            other.editor.paint({"cube": PLASTIC})
            until(lambda: len(kept(scene)) == 2)
            other.autosaver.abandon()  # closed without saving
        assert len(kept(scene)) == 1
    with opened(scene) as next_one:
        assert offer(next_one).names == ("cube",)


def test_what_was_saved_is_not_offered(left: Scene) -> None:
    """Not even if the viewer died between both; nor what a person has done by hand."""
    with opened(left) as engine:
        offer(engine)
        engine.autosaver.restore()
        until(lambda: bool(engine.unsaved))
        until(lambda: engine.autosaver._kept == edits_of(engine))
        (path,) = kept(left)
        text = path.read_text()
        engine.save()
        until(lambda: not engine.unsaved)
        until(lambda: not kept(left))
        path.write_text(text)
        die(engine)
    with opened(left) as engine:
        assert engine.autosaver.offer is None
    assert not (left.root / AUTOSAVE_NAME).exists()


def test_changes_by_others_that_leave_no_room_are_told(left: Scene) -> None:
    path = left.root / "scene.toml"
    path.write_text(path.read_text().replace('name = "cube"', 'name = "box"'))
    with opened(left) as engine:
        until(lambda: bool(engine.status.problems))
        (problem,) = engine.status.problems
        assert "cannot be restored: cube: scene.toml no longer has the object" in problem
        assert engine.autosaver.offer is None
    assert len(kept(left)) == 1


def test_a_new_object_whose_name_is_taken_by_now(left: Scene) -> None:
    path = left.root / "scene.toml"
    (left.root / "other.obj").write_text(CUBE.replace("1 -1", "2 -1"))
    cube = path.read_text().partition("[[objects]]")[2].partition("[[views]]")[0]
    other = cube.replace('"cube"', '"thing"').replace("cube.obj", "other.obj")
    path.write_text(f"{path.read_text()}\n[[objects]]{other}")
    with opened(left) as engine:
        offer(engine)
        engine.autosaver.restore()
        until(lambda: bool(engine.unsaved))
        assert engine.unsaved == ("cube", "thing-2", "gloss")


def test_a_folder_that_cannot_be_written_is_told_once(scene: Scene) -> None:
    (scene.root / AUTOSAVE_NAME).write_text("a file")
    told: list[str] = []
    with opened(scene) as engine:
        engine.autosaver._note = told.append
        for turn in range(4):
            engine.editor.place({"cube": np.diag([0.1, 0.1, 0.1 + 0.1 * turn, 1.0])})
            until(lambda: not engine.loading)
            time.sleep(0.05)
        until(lambda: bool(told))
        assert "unsaved edits are lost: cube: " in str(engine.autosaver.keep())
    assert len(told) == 1
    assert told[0].startswith("unsaved edits cannot be kept: ")
    assert "\n" not in told[0]


def test_the_user_is_told_where_the_edits_are(scene: Scene) -> None:
    with opened(scene) as engine:
        assert engine.autosaver.keep() is None
        engine.editor.remove(["cube"])
        told = "unsaved edits are kept, and offered at the next start: cube"
        assert engine.autosaver.keep() == told
        assert len(kept(scene)) == 1


def test_one_viewer_restores_at_a_time(left: Scene) -> None:
    with opened(left) as engine:
        held = Autosave(offer(engine).folder)
        told: list[str | None] = []
        engine.autosaver.restore(told.append)
        until(lambda: bool(told))
        assert "has these edits" in str(told[0])
        assert not engine.unsaved
        held.close()
    assert len(kept(left)) == 1


KILLED = """
import json, os, random, shutil, signal, sys, time
from dataclasses import replace
from pathlib import Path
import numpy as np
from iprt.scene.autosave import Found, left
from iprt.scene.light_tables import PointTable
from iprt.scene.manifest import AUTOSAVE_NAME
from iprt.scene.scene import Scene
from iprt.viewer import autosaver
from iprt.viewer.engine import Engine

scene, rounds, interval_s = Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
autosaver.INTERVAL_S = interval_s

def edit(out):
    engine = Engine(Scene.open(scene), None)
    while engine._core.files.loaded is None:
        time.sleep(0.01)
    number = 0
    while True:
        number += 1
        place = np.diag([0.1, 0.1, 0.1, 1.0])
        place[0, 3] = number / 1000
        engine.editor.place({"cube": place})
        if number % 20 == 1:
            engine.editor.add_light(PointTable(kind="point", power=1.0), np.eye(4))
        os.write(out, b"%f\\n" % time.time())
        time.sleep(0.005)

for turn in range(rounds):
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        edit(write)
    os.close(write)
    os.read(read, 1)  # it has begun
    time.sleep(interval_s + random.Random(turn).uniform(0.4, 0.8))
    os.kill(child, signal.SIGKILL)
    ended = time.time()
    os.waitpid(child, 0)
    with os.fdopen(read) as file:
        times = [float(line) for line in (file.read()).split()[1:]]
    folder, = left(scene)
    after = Found.read(folder).after
    number = round(1000 * after.objects[0].to_world[3])
    lost = ended - times[number - 2] if number > 1 else 9.0
    print(json.dumps([number, len(times), len(after.objects), lost]))
    shutil.rmtree(scene / AUTOSAVE_NAME)
"""


def test_a_viewer_that_is_killed_at_any_moment_loses_the_last_interval(scene: Scene) -> None:
    interval_s = 0.1
    done = run_python("-c", KILLED, str(scene.root), "10", str(interval_s))
    assert done.returncode == 0, done.stderr
    rounds = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(rounds) == 10
    for number, made, objects, _ in rounds:
        assert 1 < number <= made + 2
        lights = 1 + (number - 1) // 20
        assert objects - 1 in (lights, lights - 1), "the newest may be added a moment later"
    times = sorted(lost_s for *_, lost_s in rounds)
    assert times[7] < 5.0 * interval_s, "a busy machine may stop for a while"
