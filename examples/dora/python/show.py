"""A consumer in Python: prints the predictions."""

from dora import Node

for event in Node():
    if event["type"] == "INPUT":
        print(event["metadata"]["next"], event["metadata"]["nodes"], event["value"].to_pylist(), flush=True)
