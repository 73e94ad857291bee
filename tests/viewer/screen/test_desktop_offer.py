"""The window's question about unsaved edits that an earlier viewer left."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from iprt.geometry.material import Material
from iprt.scene.autosave import EDITS, Autosave
from iprt.scene.manifest import AUTOSAVE_NAME
from tests.viewer.orders import leave_edits
from tests.viewer.screen.user import User

PLASTIC = Material("plastic", (0.1, 0.6, 0.2), alpha=0.3)


@pytest.fixture
def asked(user: User, request: pytest.FixtureRequest) -> Iterator[User]:
    """Before a viewer that has found edits of two others."""
    user.at_rest()
    root = user.engine.scene.root
    for name, parts in (("older", {"removed": True}), ("newer", {"material": PLASTIC})):
        leave_edits(user.engine.scene, f"{request.node.name}-{name}", **parts)
    user.engine.autosaver.looked = False
    user.until(lambda: user.engine.autosaver.offer is not None)
    user.wait()
    yield user
    user.engine.autosaver.postpone()
    user.reset()
    user.until(lambda: not list((root / AUTOSAVE_NAME).glob(f"*/{EDITS}")))


def test_edits_are_restored_and_others_discarded(asked: User) -> None:
    user = asked
    assert user.reads("Unsaved edits of", "were found: cube.", "Restore", "Discard", "Later")
    user.press("Restore")
    user.until(lambda: user.engine.unsaved == ("cube",))
    assert user.engine.object_state("cube").materials == (PLASTIC,)
    user.until(lambda: user.engine.autosaver.offer is not None)
    user.wait()
    assert user.reads("were found: cube.")
    user.press("Discard")
    user.until(lambda: user.engine.autosaver.looked)
    user.wait()
    assert not user.reads("were found")
    assert user.engine.object_state("cube").materials == (PLASTIC,)
    user.key("z", control=True)
    assert user.engine.unsaved == ()


def test_later_keeps_them(asked: User) -> None:
    user = asked
    user.press("Later")
    user.wait()
    assert not user.reads("were found")
    kept = list((user.engine.scene.root / AUTOSAVE_NAME).glob(f"test_later*/{EDITS}"))
    assert len(kept) == 2
    for path in kept:
        folder = Autosave(path.parent)
        folder.forget()
        folder.close()
