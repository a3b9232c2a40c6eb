"""A dict that nothing changes."""

from typing import NoReturn, TypeVar

K = TypeVar("K")
V = TypeVar("V")


class FixedDict(dict[K, V]):
    """A dict that is made once; with another it gives a plain one: fixed | {name: value}."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("This dict is read-only: dict(it) gives one that can be changed")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[object, ...]:
        return FixedDict, (dict(self),)
