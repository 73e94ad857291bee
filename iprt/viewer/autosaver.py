"""Autosaves of unsaved edits in the background, and edits that earlier viewers left."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from iprt.errors import IprtError
from iprt.files.termination import undisturbed
from iprt.scene.autosave import Autosave, Found, left
from iprt.scene.edit_reading import light_edit, object_edits, table_edits
from iprt.scene.edit_writing import NewFiles, edited_text
from iprt.scene.light_edits import LightEdit
from iprt.scene.manifest import Manifest, parse_manifest
from iprt.scene.manifest_writing import free_name
from iprt.scene.object_edits import VALUES, ObjectEdit
from iprt.scene.view_edits import ViewEdit
from iprt.scene.view_reading import view_edits
from iprt.viewer.background_jobs import BackgroundJobs
from iprt.viewer.history import Edits
from iprt.viewer.scene_files import SceneFiles
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import World

LOG = logging.getLogger("iprt.viewer")
INTERVAL_S = 55.0
"""Least seconds between two autosaves: with the time that they take, a minute is lost at most."""
POLL_S = 0.5
"""Longest seconds from an edit to its autosave, if there was none for long."""
LEAVING_S = 2.0
"""Longest wait for an autosave that is under way."""
MOST_NAMES = 8
"""Limit for the names in an offer's text."""


@dataclass(frozen=True)
class Offer:
    """Unsaved edits that an earlier viewer left.

    Attributes
    ----------
    folder : Path
        Folder of their autosave.
    names : tuple of str
        Names of the objects, and keys of `[video]`.
    time_s : float
        Time of the autosave, as of `time.time`.
    """

    folder: Path
    names: tuple[str, ...]
    time_s: float

    @property
    def text(self) -> str:
        """A sentence about them."""
        then, now = time.localtime(self.time_s), time.localtime()
        today = then[:3] == now[:3]
        when = time.strftime("%H:%M" if today else "%Y-%m-%d %H:%M", then)
        more = len(self.names) - MOST_NAMES
        names = ", ".join(self.names[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
        return f"Unsaved edits of {when} were found: {names}."


class Autosaver:
    """The autosaves of one engine; all methods are thread-safe.

    Parameters
    ----------
    shared : SharedState
    files : SceneFiles
    jobs : BackgroundJobs
    note : callable
        Shows a problem; called by the engine's thread.

    Attributes
    ----------
    offer : Offer or None
        What can be restored or discarded now.
    looked : bool
        True once it is known whether there is an offer.
    """

    def __init__(
        self,
        shared: SharedState,
        files: SceneFiles,
        jobs: BackgroundJobs,
        note: Callable[[str], None],
    ) -> None:
        self._shared, self._files, self._jobs, self._note = shared, files, jobs, note
        self.offer: Offer | None = None
        self.looked = False
        self._passed: set[Path] = set()  # folders that are not offered
        self._folders: list[Autosave] = []  # of this viewer; the last one has its edits
        self._kept: Edits | None = None  # edits in the last one
        self._due_s = 0.0
        self._noted = ""
        self._abandoned = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="iprt autosave", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Keep unsaved edits for the next start, unless they are abandoned."""
        self._ended.set()
        self._thread.join(LEAVING_S)
        if (told := self.keep()) is not None:
            LOG.warning("%s", told)
        with undisturbed():
            for folder in self._folders:
                folder.close()
            self._folders.clear()

    def abandon(self) -> None:
        """Delete the autosave, and make no more: the user wants to lose the edits."""
        with undisturbed():
            self._abandoned = True
            self._forget()

    def keep(self) -> str | None:
        """Save unsaved edits now, before the viewer ends; return what to tell the user of them."""
        with undisturbed():
            world = self._shared.world
            names = ", ".join(world.unsaved)
            if self._abandoned or not names:
                self._forget()
                return None
            earlier = self._kept is not None
            try:
                self._save(world)
            except Exception as error:  # the viewer must end properly
                lost = "the last minute of unsaved edits is" if earlier else "unsaved edits are"
                return f"{lost} lost: {names}: {error}"
            return f"unsaved edits are kept, and offered at the next start: {names}"

    # The thread -------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ended.wait(min(POLL_S, INTERVAL_S)):
            try:
                if not self.looked and self._files.loaded is not None:
                    self._look(self._files.loaded.origin.root, self._files.loaded.origin.manifest)
                self._follow()
            except (IprtError, OSError) as error:
                self._tell(f"unsaved edits cannot be kept: {error}")
            except Exception as error:
                LOG.exception("a defect of iprt")
                self._tell(f"a defect of iprt: {type(error).__name__}: {error}")

    def _follow(self) -> None:
        """Save the edits if it is time."""
        world, now = self._shared.world, time.monotonic()
        if not world.unsaved:
            with undisturbed():
                self._forget()
        elif now >= self._due_s and not self._abandoned:
            self._due_s = now + INTERVAL_S
            self._save(world)

    def _save(self, world: World) -> None:
        """Save the edits of a world, unless it has been done."""
        edited, base, edits = (
            self._files.edited(),
            self._files.text,
            Edits(world.edits, world.light, world.views),
        )
        if edited is None or base is None or edits == self._kept:
            return
        with undisturbed():
            if not self._folders:
                self._folders.append(Autosave.new(edited.origin.root))
            folder = self._folders[-1]
        new = NewFiles(edited.origin, folder.folder)
        text = edited_text(new, edited.edits, edited.light, edited.text, views=edited.views)
        parse_manifest(text, "the scene with them")
        with new.sources() as copies:
            folder.copy(copies)
        with undisturbed():
            if self._folders[-1:] == [folder] and not self._abandoned:
                folder.write(base, text)
                self._kept = edits
                for other in self._folders[:-1]:
                    other.forget()

    def _forget(self) -> None:
        self._kept = None
        for folder in self._folders:
            folder.forget()

    def _tell(self, problem: str) -> None:
        """Let the engine's thread show a problem once."""
        if problem != self._noted:
            self._noted = problem
            self._jobs.start("keeping edits", lambda: lambda: self._note(problem), self._note)

    # Edits of earlier viewers -----------------------------------------------------------------

    def _look(self, root: Path, now: Manifest) -> None:
        """Look for the newest edits that can be restored."""
        for folder in left(root):
            if folder in self._passed:
                continue
            try:
                found = Found.read(folder)
                edits = table_edits(root, found.before, found.after, now)
            except IprtError as error:
                self._passed.add(folder)
                self._tell(f"unsaved edits cannot be restored: {error}")
                continue
            light = light_edit(found.before, found.after, now)
            views = (edit.shown_name for edit in view_edits(found.before, found.after, now))
            names = (*(edit.name for edit in edits), *views, *light.parts)
            if names:
                self.offer = Offer(folder, names, found.time_s)
                break
            self._delete(folder)  # the scene has them
        self.looked = True

    def restore(self, done: Callable[[str | None], object] = lambda _: None) -> None:
        """Make the offered edits unsaved edits again, in one step of undo.

        Parameters
        ----------
        done : callable
            Called with the problem, or None after success.
        """
        offer, loaded = self._take(), self._files.loaded
        if offer is None or loaded is None:
            done(None)
            return
        scene = loaded.origin

        def job() -> Callable[[], None]:
            folder = Autosave(offer.folder)
            try:
                found = Found.read(folder.folder)
                tables = table_edits(scene.root, found.before, found.after, scene.manifest)
                edits = object_edits(scene, tables)
            except BaseException:
                folder.close()
                raise
            light = light_edit(found.before, found.after, scene.manifest)
            views = view_edits(found.before, found.after, scene.manifest)
            known = {table.name for table in scene.manifest.objects}

            def finish() -> None:
                with undisturbed():
                    self._folders.append(folder)
                    self._kept, self._due_s = None, 0.0
                self._shared.edit(lambda world: having(world, edits, light, views, known))
                self.looked = False
                done(None)

            return finish

        def fail(problem: str) -> None:
            self._note(f"unsaved edits cannot be restored: {problem}")
            self.looked = False
            done(problem)

        self._passed.add(offer.folder)
        self._jobs.start("restoring unsaved edits", job, fail)

    def discard(self) -> None:
        """Delete the offered edits."""
        if (offer := self._take()) is not None:
            self._delete(offer.folder)
            self.looked = False

    def postpone(self) -> None:
        """Offer the edits again at the next start."""
        self._take()

    def _take(self) -> Offer | None:
        offer, self.offer = self.offer, None
        return offer

    @staticmethod
    def _delete(folder: Path) -> None:
        with suppress(IprtError):  # another viewer restores them
            autosave = Autosave(folder)
            autosave.forget()
            autosave.close()


def having(
    world: World,
    edits: Sequence[ObjectEdit],
    light: LightEdit,
    views: Sequence[ViewEdit],
    known: set[str],
) -> World:
    """Return a world with further edits; new objects whose names are taken get others.

    `known` are the names of the objects in the scene's files.
    """
    taken = known | {edit.name for edit in world.edits}
    for edit in edits:
        before = world.edit_of(edit.name)
        if edit.name in known:
            rest = {part: getattr(before, part) for part in VALUES if getattr(edit, part) is None}
            edit = replace(edit, **rest)
        else:
            if edit.name in taken:
                edit = replace(edit, name=free_name(edit.name, taken))
            taken.add(edit.name)
        world = world.having(edit)
    others = {view.name: view for view in (*world.views, *views)}
    light = replace(world.light, **light.parts)
    return replace(world, light=light, views=tuple(others.values()))
