"""The spelling of the contract's constants: ENERGY_LINEAR_ELASTIC is "linear-elastic"."""
from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from typing import Any


def _prefix(enum: Any) -> str:
    """The prefix of an enum's constants: JOB_STATE_ for JobState."""
    return re.sub(r"(?<=.)([A-Z])", r"_\1", str(enum.name)).upper() + "_"


def spelled(enum: Any, number: int) -> str:
    """The spelling of a value, or its number if this package does not know the value."""
    value = enum.values_by_number.get(number)
    if value is None:
        return str(number)
    return str(value.name).removeprefix(_prefix(enum)).lower().replace("_", "-")


def spellings(enum: Any) -> dict[str, int]:
    """All values except UNSPECIFIED, by their spelling."""
    return {spelled(enum, value.number): value.number for value in enum.values if value.number != 0}


def suggestion(word: str, known: Iterable[str]) -> str:
    """The end of an error's sentence: the word that was probably meant, or all known words."""
    known = list(known)
    near = difflib.get_close_matches(word, known, 1)
    return f"did you mean '{near[0]}'?" if near else "take one of " + ", ".join(known) + "."


def counted(count: int, one: str, many: str = "") -> str:
    """ "1 element" or "3 elements". `many` is the plural, if it is not `one` with an s."""
    return f"{count} {one if count == 1 else many or one + 's'}"
