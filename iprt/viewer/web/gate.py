"""Who may see the viewer: each request is judged before anything is served."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from iprt.errors import IprtError

MIN_TOKEN = 12
"""Characters of a token: fewer can be guessed."""
ALIVE = "/alive"
"""Where pages ask whether the viewer still runs; see `alive.js`."""

_HEADERS = {
    "Cache-Control": "no-store",
    # The page may fetch nothing from elsewhere, and may stand in no other page.
    "Content-Security-Policy": (
        "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; frame-ancestors 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


@dataclass(frozen=True)
class Address:
    """Where a viewer can be reached.

    Attributes
    ----------
    url : str
        With the token, if there is one.
    port : int
    local : bool
        From this machine alone.
    """

    url: str
    port: int
    local: bool


def new_token() -> str:
    """One that cannot be guessed."""
    return secrets.token_urlsafe(24)


def require_token(token: str) -> str:
    """A token that may be part of a URL and of a cookie, and is long enough.

    Raises
    ------
    IprtError
    """
    plain = token.isascii() and token.replace("-", "").replace("_", "").isalnum()
    if not plain or len(token) < MIN_TOKEN:
        raise IprtError(
            f"the token needs at least {MIN_TOKEN} characters, of letters, digits, - and _; "
            "leave it out to get one"
        )
    return token


def is_loopback(host: str) -> bool:
    """Whether a host's name or address is of this machine alone."""
    if host.lower().rstrip(".") == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


@dataclass(frozen=True)
class Gate:
    """Answers requests that may not pass, and those for the page.

    Attributes
    ----------
    page : bytes
        The HTML page.
    port : int
    token : str or None
        What clients must know. None: everybody may come who can reach the port, which is to be
        that of a loopback address then.
    run : str
        Made anew whenever the viewer is started, and known only to pages that passed: they ask for
        it at `ALIVE`, and viser's clients show by it that they did.
    """

    page: bytes = field(repr=False)
    port: int
    token: str | None = field(repr=False)
    run: str = field(repr=False)

    def answer(self, _connection: Any, request: Request) -> Response | None:
        """The answer for `websockets` to send; None: the WebSocket may be opened."""
        parts = urlsplit(request.path)
        host = _only(request.headers, "Host")
        # A page of elsewhere whose name was made to mean this machine has that name here.
        if host is None or (self.token is None and not is_loopback(_name(host))):
            return _plain(HTTPStatus.FORBIDDEN, "Open this viewer as localhost.")
        offered = parse_qs(parts.query).get("token", ())
        if not self._knows([*offered, *self._cookies(request)]):
            return _plain(HTTPStatus.UNAUTHORIZED, "Open the URL that the viewer printed.")
        if "websocket" in (_only(request.headers, "Upgrade") or "").lower():
            origins = request.headers.get_all("Origin")
            if any(urlsplit(origin).netloc != host for origin in origins):
                return _plain(HTTPStatus.FORBIDDEN, "A page of elsewhere may not do this.")
            return None
        if parts.path == ALIVE:
            return _plain(HTTPStatus.OK, self.run)
        if parts.path != "/":
            return _plain(HTTPStatus.NOT_FOUND, "There is nothing here.")
        if self.token is not None and offered:
            # On with a cookie, so that the token leaves the address bar.
            cookie = f"{self._cookie}={self.token}; Path=/; HttpOnly; SameSite=Lax"
            moved = _plain(HTTPStatus.SEE_OTHER, "")
            moved.headers["Location"] = "/"
            moved.headers["Set-Cookie"] = cookie
            return moved
        return _response(HTTPStatus.OK, "text/html; charset=utf-8", self.page)

    @property
    def _cookie(self) -> str:
        # Browsers share cookies among all ports of a host.
        return f"iprt-{self.port}"

    def _knows(self, offered: Sequence[str]) -> bool:
        if self.token is None:
            return True
        token = self.token.encode()
        known = [hmac.compare_digest(text.encode(), token) for text in offered]
        return any(known)

    def _cookies(self, request: Request) -> list[str]:
        found = []
        for header in request.headers.get_all("Cookie"):
            try:
                morsel = SimpleCookie(header).get(self._cookie)
            except CookieError:
                continue
            if morsel is not None:
                found.append(morsel.value)
        return found


def _only(headers: Headers, name: str) -> str | None:
    """The header that there is once."""
    values = headers.get_all(name)
    return values[0] if len(values) == 1 else None


def _name(host: str) -> str:
    """A Host header without the port."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _plain(status: HTTPStatus, text: str) -> Response:
    return _response(status, "text/plain; charset=utf-8", (text + "\n").encode() if text else b"")


def _response(status: HTTPStatus, kind: str, body: bytes) -> Response:
    headers = Headers(_HEADERS)
    headers["Content-Type"] = kind
    headers["Content-Length"] = str(len(body))
    headers["Connection"] = "close"
    return Response(status.value, status.phrase, headers, body)
