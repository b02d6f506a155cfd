"""Mappings that cannot be changed: hashable, picklable, copied like any value."""

from __future__ import annotations

from typing import Any, NoReturn, TypeVar

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


class FrozenDict(dict[_Key, _Value]):
    """A dict that refuses every change. Equal ones hash equal, if their values can be hashed.

    A dict, so that ``dataclasses.asdict`` and ``json`` look inside; ``dict(it)`` is a copy that
    can be changed.
    """

    def __hash__(self) -> int:  # type: ignore[override]
        """A hash that does not depend on the order.

        Raises:
            TypeError: A value cannot be hashed.
        """
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[Any, ...]:
        """How to make it again: as a whole, because single items cannot be set."""
        return type(self), (dict(self),)

    def _refuse(self, *_arguments: Any, **_named: Any) -> NoReturn:
        raise TypeError("this mapping cannot be changed; make a new one, such as {**old, key: 1}")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]
