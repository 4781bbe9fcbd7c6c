"""A retried request takes effect once (spec motion-controller §7.2, 8)."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import msgspec


@dataclass(frozen=True)
class Fresh:
    """Execute it, then ``finish`` with the key (``None``: nothing to remember)."""

    key: tuple[str, bytes] | None


@dataclass(frozen=True)
class Repeated:
    """It was executed before, with this answer. ``None``: it is still being executed under the same key, and its answer
    serves both."""

    answer: bytes | None
    key: tuple[str, bytes]


@dataclass
class _Kept:
    digest: bytes
    answer: bytes | None
    until: int | None  # None while it is being executed


class ReplyMemory:
    """Remembers answers by (client, id) for ``life_ns`` after they were given.

    A retry is the same text under the same id as the client's last request of that id, and a matter of seconds: a
    program that numbers its requests from 1 and is started again means what it sends. Clients that give every request
    the same id are not held up: another request in between ends the memory of the one before. What is idempotent by
    nature (a lock, a stop, a velocity, a setting, a question) is carried out every time, because it refreshes something
    or its answer changes; what was refused had no effect and may be tried again. Times are nanoseconds of the caller's
    clock.
    """

    def __init__(self, life_ns: int, clients: int = 64, ids: int = 128) -> None:
        self._life_ns = life_ns
        self._clients = clients
        self._ids = ids
        self._kept: OrderedDict[str, OrderedDict[bytes, _Kept]] = OrderedDict()

    def begin(self, client: str, echo: dict[str, Any], text: bytes | str, once: bool, now: int) -> Fresh | Repeated:
        """``echo``: ``{"id": …}`` or empty. ``once``: the request must not take effect twice."""
        if not echo:
            return Fresh(None)
        key, digest = _digest(msgspec.json.encode(echo["id"])), _digest(text)
        known = self._kept.get(client, OrderedDict()).get(key)
        alive = known is not None and (known.until is None or now < known.until)
        if known and alive and once and known.digest == digest:
            return Repeated(known.answer, (client, key))
        self._forget(client, key)
        if not once:
            return Fresh(None)
        mine = self._kept.setdefault(client, OrderedDict())
        self._kept.move_to_end(client)
        mine[key] = _Kept(digest, None, None)
        if len(mine) > self._ids:
            mine.popitem(last=False)
        if len(self._kept) > self._clients:
            self._kept.popitem(last=False)
        return Fresh((client, key))

    def finish(self, key: tuple[str, bytes] | None, answer: bytes, took_effect: bool, now: int) -> None:
        if key is None:
            return
        client, id_ = key
        kept = self._kept.get(client, OrderedDict()).get(id_)
        if kept is None:
            return
        if took_effect:
            kept.answer, kept.until = answer, now + self._life_ns
        else:
            self._forget(client, id_)

    def _forget(self, client: str, key: bytes) -> None:
        mine = self._kept.get(client)
        if mine is not None:
            mine.pop(key, None)
            if not mine:
                del self._kept[client]


def _digest(text: bytes | str) -> bytes:
    return hashlib.blake2b(text.encode() if isinstance(text, str) else text, digest_size=16).digest()
