"""The scene's files while a viewer has them open: read, watched, read again, written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from iprt.errors import IprtError
from iprt.scene.edits import save_edits
from iprt.scene.objects import SceneObject
from iprt.scene.scene import Scene
from iprt.viewer.exchange import Exchange
from iprt.viewer.loading import Loader
from iprt.viewer.watch import Stamp, Watch

POLL_S = 0.5
"""Between two looks whether files were written."""


@dataclass(frozen=True, eq=False)
class Loaded:
    """A scene with what its files hold.

    Attributes
    ----------
    scene : Scene
    stamp : Stamp
        Of the files that frames are made of.
    objects : tuple of SceneObject
    problem : str or None
        Why the objects are not there.
    """

    scene: Scene
    stamp: Stamp
    objects: tuple[SceneObject, ...]
    problem: str | None = None

    def same_video(self, other: Loaded) -> bool:
        """Whether both show the same frames."""
        one, two = self.scene.manifest, other.scene.manifest
        return self is other or (
            self.stamp == other.stamp
            and one.video == two.video
            and one.real_materials == two.real_materials
        )


class SceneFiles:
    """Keeps what was read last while other threads read again. Any thread may call `save`.

    Parameters
    ----------
    scene : Scene
    exchange : Exchange
    loader : Loader
    problems : dict of str to str
        Messages by what they are about, here "scene" and "save".
    clock : callable
        Seconds.
    allow_outside : bool
        See `Scene.open`.

    Attributes
    ----------
    loaded : Loaded or None
        None: nothing yet.
    """

    def __init__(
        self,
        scene: Scene,
        exchange: Exchange,
        loader: Loader,
        problems: dict[str, str],
        *,
        clock: Callable[[], float],
        allow_outside: bool,
    ) -> None:
        self._first, self._exchange, self._loader = scene, exchange, loader
        self._problems, self._clock = problems, clock
        self._allow_outside = allow_outside
        self._watch = Watch(scene.root)
        self._polled_s = clock()
        self.loaded: Loaded | None = None
        self._read(scene.name, "scene", lambda: load_what_can_be(scene, self._watch.look()))

    def poll(self) -> None:
        """Read again if it is time to look, and files were written."""
        now = self._clock()
        if now - self._polled_s < POLL_S or self._loader.running:
            return
        self._polled_s = now
        if self._watch.changed():
            self._read(str(self._first.root), "scene", self._reloaded)

    def save(self, done: Callable[[str | None], object] = lambda _: None) -> None:
        """Write all edits to the scene's file, and go on with what that says then.

        `done` is told what went wrong, or None, where there was something to write.
        """
        edits = self._exchange.world.edits
        if self.loaded is None or not edits:
            return
        scene = self.loaded.scene

        def write() -> Loaded:
            save_edits(scene, edits)
            return self._reloaded()

        def saved() -> None:
            self._exchange.saved(edits)
            done(None)

        self._read(f"saving {scene.name}", "save", write, saved, done)

    def _reloaded(self) -> Loaded:
        stamp = self._watch.look()
        return load(Scene.open(self._first.root, allow_outside=self._allow_outside), stamp)

    def _read(
        self,
        what: str,
        about: str,
        read: Callable[[], Loaded],
        then: Callable[[], object] = lambda: None,
        otherwise: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Begin to read; where that fails, all stays as it is, but for a message."""

        def job() -> Callable[[], None]:
            loaded = read()

            def finish() -> None:
                self.loaded = loaded
                for solved in {about, "scene"}:
                    self._problems.pop(solved, None)
                if loaded.problem is not None:
                    self._problems["scene"] = loaded.problem
                then()

            return finish

        def fail(problem: str) -> None:
            self._problems[about] = problem
            otherwise(problem)

        self._loader.start(what, job, fail)


def load(scene: Scene, stamp: Stamp) -> Loaded:
    """Read what is needed besides frames.

    Raises
    ------
    FormatError
        An object, or what the video's files say of themselves, cannot be read.
    """
    objects = scene.objects
    # Kept by the scene: nobody waits for these files later.
    assert scene.real_materials is not None
    assert scene.source.white > 0.0
    return Loaded(scene, stamp, objects)


def load_what_can_be(scene: Scene, stamp: Stamp) -> Loaded:
    """As `load`, without objects where these cannot be read.

    Raises
    ------
    FormatError
        The video's files cannot be read.
    """
    try:
        return load(scene, stamp)
    except IprtError as error:
        assert scene.source.white > 0.0
        return Loaded(scene, stamp, (), str(error))
