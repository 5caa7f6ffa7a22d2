"""Reading of recordings, compared with other readers, on the files that `--example readers` writes.

    python3 benches/peers/readers.py [--python ENV/bin/python] [--folder FOLDER] [--json]

Without --python, an environment with the wheels is made in target/readers-venv. A reader that does not know a format, or that
reads other events than ours, is marked and not timed. All files are in the page cache; a figure is the median of seven runs.
"""
import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
EVENTS = 1_000_000
RUNS = 7


def with_faery(path):
    """The columns t, x, y and p of the file at `path`, as faery reads them."""
    import faery
    import numpy as np

    arrays = [array.copy() for array in faery.events_stream_from_file(path)]
    events = np.concatenate(arrays)
    return [events[name].astype("int64") for name in ("t", "x", "y", "on" if "on" in events.dtype.names else "p")]


def with_expelliarmus(path):
    """The same, as expelliarmus reads them."""
    from expelliarmus import Wizard

    encodings = {".dat": "dat", ".evt2.raw": "evt2", ".evt3.raw": "evt3"}
    encoding = next(encoding for end, encoding in encodings.items() if path.name.endswith(end))
    events = Wizard(encoding=encoding).read(path)
    return [events[name].astype("int64") for name in "txyp"]


def with_dv(path):
    """The same, as iniVation's dv-processing reads them."""
    import dv_processing as dv
    import numpy as np

    if not path.name.endswith(".aedat4"):
        raise ImportError
    reader, batches = dv.io.MonoCameraRecording(str(path)), []
    while (batch := reader.getNextEventBatch()) is not None:
        batches.append(batch.numpy())
    events = np.concatenate(batches)
    return [events[name].astype("int64") for name in ("timestamp", "x", "y", "polarity")]


def with_mcap(path):
    """The same, from packets in `mono` that the Python package mcap reads; NumPy separates their fields."""
    import numpy as np
    from mcap.reader import make_reader

    if path.suffix != ".mcap":
        raise ImportError
    parts, bases = [], []
    with open(path, "rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/events"], log_time_order=False):
            # After the first four bytes, the name of the frame is the only field of another length before the events.
            at = 16 + (int.from_bytes(message.data[12:16], "little") + 3) // 4 * 4
            at += 8 + -(at + 8 - 4) % 8 + 8
            bases.append(int.from_bytes(message.data[at:at + 8], "little"))
            # The encoding "mono" with its length and zero, the byte order, and the number of events.
            parts.append(np.frombuffer(message.data, dtype="<u8", offset=at + 8 + 16))
    bits = np.concatenate(parts)
    base = np.repeat(np.array(bases, dtype="u8"), [len(part) for part in parts])
    t = (base + (bits & 0xFFFFFFFF)) // 1000
    return [t.astype("int64"), (bits >> 32 & 0xFFFF).astype("int64"), (bits >> 48 & 0x7FFF).astype("int64"), (bits >> 63).astype("int64")]


PEERS = {"faery": with_faery, "expelliarmus": with_expelliarmus, "dv-processing": with_dv, "mcap": with_mcap}


def expected():
    """The beginning and the end of the events that `--example readers` writes."""
    first = [0, 173 + 60, 130, 1]
    return first, (EVENTS - 1) * 100 + (EVENTS - 1) % 7


def measure(read, path):
    """Events per second, or the reason why there is no figure."""
    try:
        t, x, y, p = read(path)
    except (StopIteration, ImportError):
        return "not read"
    except Exception as error:  # An exception of another reader is a result.
        return f"fails: {str(error)[:60]}"
    first, last = expected()
    if len(t) != EVENTS:
        return f"reads {len(t)} events"
    # Some readers count from the first event, and some rows from the bottom.
    if t[-1] - t[0] != last or [x[0], p[0]] != [first[1], first[3]]:
        return "reads other events"
    times = []
    for _ in range(RUNS):
        start = time.perf_counter()
        read(path)
        times.append(time.perf_counter() - start)
    return EVENTS / statistics.median(times)


def peers(folder):
    """Prints a line of JSON for each file."""
    for path in sorted(folder.iterdir()):
        row = {"file": path.name}
        row |= {name: measure(read, path) for name, read in PEERS.items()}
        print(json.dumps(row), flush=True)


def environment():
    """The Python of an environment with the wheels."""
    folder = ROOT / "target/readers-venv"
    python = folder / "bin/python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *PEERS, "numpy"], check=True)
    return python


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--python", help="interpreter of an environment with the other readers")
    arguments.add_argument("--folder", type=pathlib.Path, default=ROOT / "target/readers")
    arguments.add_argument("--json", action="store_true", help="print one JSON object for each file")
    arguments.add_argument("--peers", action="store_true", help=argparse.SUPPRESS)
    asked = arguments.parse_args()
    if asked.peers:
        return peers(asked.folder)
    command = ["cargo", "run", "-q", "--release", "-p", "meissner-benches", "--example", "readers", "--"]
    ours = subprocess.run(command + [str(asked.folder), "--json"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    rows = {row["file"]: row for row in map(json.loads, ours.stdout.splitlines())}
    command = [asked.python or environment(), __file__, "--peers", "--folder", asked.folder]
    theirs = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    for row in map(json.loads, theirs.stdout.splitlines()):
        rows.get(row["file"], {}).update(row)
    if not asked.json:
        print(f"{'M events/s':<20} {'meissner':>10}" + "".join(f" {name:>24}" for name in PEERS))
    for row in rows.values():
        if asked.json:
            print(json.dumps(row))
            continue
        shown = [f"{rate / 1e6:.1f}" if isinstance(rate, (int, float)) else rate
                 for rate in (row["events_per_s"], *(row[name] for name in PEERS))]
        print(f"{row['file']:<20} {shown[0]:>10}" + "".join(f" {rate:>24}" for rate in shown[1:]))
    return None


if __name__ == "__main__":
    main()
