#!/usr/bin/env python3
"""Writes twenty_fingertips.yml, which contains the same lines twenty times."""

from pathlib import Path

FINGERS = [f"finger{number:02}" for number in range(20)]
NODE = "    path: target/release/meissner-dora\n"

sources = "".join(
    f"  - id: {finger}\n{NODE}    args: source --runs 20 --speed 0.02 --every-us 5000\n    outputs: [events, counters]\n"
    for finger in FINGERS
)
events = "".join(f"      {finger}: {{ source: {finger}/events, queue_size: 256 }}\n" for finger in FINGERS)
counters = "".join(
    f"      counters-{finger}: {{ source: {finger}/counters, queue_size: 64 }}\n" for finger in FINGERS
)
flow = f"""\
# Twenty fingertips on one machine: twenty sources, and one process with twenty engines over one copy of the weights.
# Written by twenty_fingertips.py.
nodes:
{sources}
  - id: inference
{NODE}    args: infer --network tactigraph-past --every-ms 10 --state out/twenty_fingertips
    inputs:
{events}    outputs: [predictions, losses, counters]
    restart_policy: on-failure
    restart_delay: 0.1

  - id: controller
{NODE}    args: control --period-ms 20 --deadline-ms 10
    inputs:
      predictions: {{ source: inference/predictions, queue_size: 256 }}
    outputs: [commands, counters]

  - id: recorder
{NODE}    args: record out/twenty_fingertips.jsonl
    inputs:
      predictions: {{ source: inference/predictions, queue_size: 16384 }}
      # Each is worth having: through the daemons, which drop nothing.
      losses: {{ source: inference/losses, queue_size: 4096, queue_policy: backpressure }}
      counters: {{ source: inference/counters, queue_size: 256 }}
{counters}      commands: {{ source: controller/commands, queue_size: 4096 }}

  - id: metrics
{NODE}    args: metrics --listen 127.0.0.1:9464
    inputs:
      predictions: {{ source: inference/predictions, queue_size: 4096 }}
      counters: {{ source: inference/counters, queue_size: 256 }}
      counters-controller: {{ source: controller/counters, queue_size: 256 }}
{counters}"""
Path(__file__).with_suffix(".yml").write_text(flow)
