"""Numbers of elements and nodes: those of a file as the file has them, those of arrays from 0.

The server numbers the elements and nodes of arrays from 1, in the order in which they are sent.
"""
from __future__ import annotations

import re
from collections.abc import Iterable

# "element 5", "nodes 3, 4 and 7", "elements 1 to 3": a word that names what is numbered, then numbers. A count at the
# end, as in "elements 1, 2 and 12 more", is no number.
_NAMED = re.compile(r"\b(?:elements?|nodes?|vertex|vertices|cells?|triangles?|quadrilaterals?|tetrahedr(?:on|a)|pyramids?"
                    r"|prisms?|hexahedr(?:on|a))"
                    r" \d+\b(?:(?:, and |, | and | to )\d+\b(?! more\b))*", re.IGNORECASE)  # fmt: skip


class Numbering:
    """How the numbers of the server become those of the caller: the same, or one less for arrays."""

    def __init__(self, from_zero: bool) -> None:
        self._shift = 1 if from_zero else 0

    def numbers(self, values: Iterable[int]) -> tuple[int, ...]:
        return tuple(value - self._shift for value in values)

    def number_or_none(self, value: int) -> int | None:
        """A number for which the server's 0 means none."""
        return None if value == 0 else value - self._shift

    def sentence(self, text: str) -> str:
        """A sentence of the server, with the caller's numbers."""
        if self._shift == 0:
            return text
        return _NAMED.sub(lambda found: re.sub(r"\d+", lambda n: str(int(n[0]) - self._shift), found[0]), text)


OF_FILES = Numbering(from_zero=False)
OF_ARRAYS = Numbering(from_zero=True)
