"""What is named and not imported: an object of the package by its place, loaded when somebody asks for it.

A table of such names knows its entries without their implementations: a rig names its drive, its plant and its law, and
none of them is loaded before somebody runs it.
"""

from importlib import import_module
from typing import Any, Generic, TypeVar, overload

Value = TypeVar("Value", covariant=True)


def resolve(place: str) -> Any:
    """The object at ``room.file:name``, or the module where no name follows.

    >>> resolve("core.units:RADIANS") * 180.0
    3.141592653589793
    """
    module, _, name = place.partition(":")
    found = import_module(f"bowden.{module}")
    return getattr(found, name) if name else found


class Derived(Generic[Value]):
    """An attribute that follows from an object's fields: the function of its name in a file computes it once."""

    def __init__(self, file: str) -> None:
        self.file = file

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, one: None, owner: type) -> "Derived[Value]": ...

    @overload
    def __get__(self, one: object, owner: type) -> Value: ...

    def __get__(self, one: Any, owner: type) -> Any:
        if one is None:
            return self
        found = one.__dict__[self.name] = resolve(f"{self.file}:{self.name}")(one)
        return found
