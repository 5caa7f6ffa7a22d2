"""Durations as microseconds."""

from __future__ import annotations

import numpy as np

from ._errors import DtypeError, InputError

# Number of units in a microsecond.
_FINER = {"ns": 10**3, "ps": 10**6, "fs": 10**9, "as": 10**12}


def microseconds(times: np.ndarray) -> np.ndarray:
    """An array of timedelta64 as int64: a view if its unit is the microsecond, otherwise rounded to the nearest, halves away from zero."""
    unit, count = np.datetime_data(times.dtype)
    if unit in ("generic", "M", "Y"):
        raise DtypeError(f"t: expected timedelta64 of a unit from weeks to attoseconds, found {times.dtype}")
    missing = np.isnat(times)
    if missing.any():
        raise InputError(f"t: expected times, found NaT as event {int(missing.argmax())}")
    if (unit, count) == ("us", 1):
        return times.view(np.dtype("i8").newbyteorder(times.dtype.byteorder))
    if unit not in _FINER:
        too_long = InputError("t: expected at most 2^63 - 1 us, found a longer time")
        try:
            converted = times.astype("m8[us]")
        except OverflowError:  # Older versions of NumPy wrap, newer ones raise.
            raise too_long from None
        if (converted.astype(times.dtype) != times).any():
            raise too_long
        return converted.view("i8")
    # Values in the plain unit, such as ns if the type has 10 ns.
    values = times.astype(f"m8[{unit}]").view("i8")
    whole, rest = np.divmod(np.abs(values), _FINER[unit])
    return np.sign(values) * (whole + (2 * rest >= _FINER[unit]))
