"""Runs a command whose threads have short time slices, so that none of them blocks a core for the others for long.

    python3 benches/slice.py MICROSECONDS COMMAND ARGUMENT...

Linux 6.12 and later take a slice for normal threads (sched(7), sched_setattr(2)); threads and processes of the command inherit it. As root,
the command also gets the niceness -20.
"""

import ctypes
import os
import platform
import struct
import sys

# The number of sched_setattr(2).
CALLS = {"x86_64": 314, "aarch64": 274}


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    nice = -20 if os.geteuid() == 0 else 0
    # struct sched_attr: size, policy (SCHED_OTHER), flags, nice, priority, runtime in ns, deadline, period.
    attributes = struct.pack("IIQiIQQQ", 48, 0, 0, nice, 0, int(sys.argv[1]) * 1000, 0, 0)
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.syscall(CALLS[platform.machine()], 0, attributes, 0) != 0:
        sys.exit(f"sched_setattr: {os.strerror(ctypes.get_errno())}")
    os.execvp(sys.argv[2], sys.argv[2:])


if __name__ == "__main__":
    main()
