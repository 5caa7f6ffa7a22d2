"""Durations as microseconds."""

from __future__ import annotations

import numpy as np

from ._errors import DtypeError, InputError

# How many of a unit are a microsecond.
_FINER = {"ns": 10**3, "ps": 10**6, "fs": 10**9, "as": 10**12}


def microseconds(times: np.ndarray) -> np.ndarray:
    """An array of timedelta64 as int64: in place if its unit is the microsecond, and else rounded to the nearest, halves away from zero."""
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
        except OverflowError:  # What older versions of NumPy wrap, newer ones refuse.
            raise too_long from None
        if (converted.astype(times.dtype) != times).any():
            raise too_long
        return converted.view("i8")
    # In the unit itself, without a multiple.
    values = times.astype(f"m8[{unit}]").view("i8")
    whole, rest = np.divmod(np.abs(values), _FINER[unit])
    return np.sign(values) * (whole + (2 * rest >= _FINER[unit]))
