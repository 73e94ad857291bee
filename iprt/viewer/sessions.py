"""The sessions of all clients: whose picture is next, and which renderers stay in memory."""

from __future__ import annotations

from collections.abc import Mapping

from iprt.device.compute import ComputeDevice
from iprt.viewer.accumulating_renderer import Stage
from iprt.viewer.compiling import Compiling
from iprt.viewer.session import Session
from iprt.viewer.shared_state import NumberedRequest
from iprt.world.shared import Worlds

MOST_BYTES = 1_500_000_000
"""Most bytes of a CPU's buffers, beyond which renderers of other clients are closed."""


class Sessions(dict[int, Session]):
    """Sessions by client, the one that rendered longest ago first.

    Parameters
    ----------
    compiling : Compiling
        Counter of pending compilations.
    worlds : Worlds
        Worlds of the device.
    """

    def __init__(self, compiling: Compiling, worlds: Worlds) -> None:
        super().__init__()
        self._compiling, self._worlds = compiling, worlds
        self._behind: list[int] = []  # clients that wait for a change
        self._crowded = False  # the newest renderer displaced another client's

    def most_urgent(
        self,
        stage: Stage,
        requests: Mapping[int, NumberedRequest],
        failed: Mapping[int, tuple[Stage, NumberedRequest]],
    ) -> int | None:
        """Return the client to render for, or None.

        Clients waiting for a change come before clients whose picture can be refined. Among equals,
        the client who has waited longest comes first. Pictures whose renderers do not fit beside
        each other are refined one after another, as each would restart in every turn.
        """
        for client in requests.keys() - self.keys():
            self[client] = Session(self._compiling, self._worlds, self._make_room)
        self._behind, resting = [], []
        for client, session in self.items():
            asked = requests.get(client)
            if asked is None or failed.get(client) == (stage, asked):
                continue
            if session.behind(stage, asked.number):
                self._behind.append(client)
            elif session.unrefined(asked.request):
                resting.append(client)
        if self._behind:
            return self._behind[0]
        return resting[-1 if self._crowded else 0] if resting else None

    def begin(self, client: int) -> Session:
        """Return the session that renders next."""
        session = self[client] = self.pop(client)
        return session

    def _make_room(self, device: ComputeDevice, pixels: int, needed: int) -> None:
        """Close renderers until one of `needed` bytes fits, if the device is a CPU.

        The renderers that other clients used longest ago go first, unless a client waits for a
        change: moving pictures in turn would lose their histories. The session's own ones go if
        they have about the same size: others are for motion, or for rest.
        """
        *others, own = self
        self._crowded = False

        def full() -> bool:
            return device.is_cpu and device.hosted + needed > MOST_BYTES

        for client in others:
            while client not in self._behind and full() and self[client].shed():
                self._crowded = True
        while full() and self[own].shed(pixels):
            pass
