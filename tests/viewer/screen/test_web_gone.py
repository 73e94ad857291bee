"""What a page says when its server is gone, and what it does when there is one again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from iprt.viewer.web.host import Host
from iprt.viewer.windows import Start
from tests.viewer.screen.browsing import DEADLINE_S, Visitor, until
from tests.viewer.screen.web import Place, at_rest


@contextmanager
def hosting(viewer: Place, port: int) -> Iterator[Host]:
    """Another server of the same engine."""
    start = Start(viewer.engine.scene.views["ahead"].view)
    with Host(viewer.engine, start, port) as host:
        yield host


def alert(visitor: Visitor) -> str:
    """What the page tells of the server, as soon as it does."""
    notice = visitor.page.get_by_role("alert").filter(has_text="server")
    notice.wait_for(timeout=1000 * DEADLINE_S)
    return str(notice.inner_text())


def test_a_server_that_stops_and_starts_again(place: Place) -> None:
    with hosting(place, 0) as first:
        visitor = place.open(first.url)
        until(lambda: first.browsers, "nobody came")
        at_rest(visitor, first.browsers[0])
        visitor.page.evaluate("window.mark = 1")
    words = alert(visitor)
    assert "The server has stopped" in words
    assert "iprt view --web" in words
    with hosting(place, first.port) as second:
        visitor.page.get_by_role("alert").filter(has_text="server").wait_for(
            state="detached", timeout=1000 * DEADLINE_S
        )
        # viser's page comes by itself; it must be loaded anew, for its scripts may be old.
        visitor.page.wait_for_function("!window.mark", timeout=1000 * DEADLINE_S)
        until(lambda: len(second.browsers) == 1, "it does not come back")
        visitor.decoded()
        at_rest(visitor, second.browsers[0])
    alert(visitor)
    visitor.page.close()


def test_a_network_that_fails_for_a_while(place: Place) -> None:
    """The page goes on as it was: nothing of it is lost."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    visitor.page.evaluate("window.mark = 1")
    visitor.page.route("**/alive", lambda route: route.abort())
    assert "cannot be reached" in alert(visitor)
    visitor.page.unroute("**/alive")
    visitor.page.get_by_role("alert").filter(has_text="server").wait_for(
        state="detached", timeout=1000 * DEADLINE_S
    )
    assert visitor.page.evaluate("window.mark") == 1
    visitor.errors.clear()  # of the requests that failed
