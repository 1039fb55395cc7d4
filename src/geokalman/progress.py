"""How far a long loop has come, told to whoever listens: nobody, unless a notebook is being executed.

A loop says it in passing, ``for seed in track(seeds, "seeds")``, and no signature carries it. Standard library only.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")
Listener = Callable[[str, float], None]
"""Called with what is being done and the share of it that is done, 0 to 1."""

_listeners: list[Listener] = []


def listen(listener: Listener | None) -> None:
    """Let this listener, and no other, hear of the loops of this process; None for nobody."""
    _listeners[:] = [] if listener is None else [listener]


def share(what: str) -> Callable[[float], None]:
    """Function that tells the share done of `what`."""

    def tell(done: float) -> None:
        for listener in _listeners:
            listener(what, done)

    return tell


def track(items: Iterable[T], what: str, total: int | None = None) -> Iterator[T]:
    """The items one after the other; as each is done with, the share done of `what` is told.

    total: how many there are, where `items` has no length.
    """
    tell = share(what)
    count = total if total is not None else len(items) if isinstance(items, Collection) else 0
    tell(0.0)
    for done, item in enumerate(items, 1):
        yield item
        if count:
            tell(min(1.0, done / count))
