"""Recordings for tests: made of known impacts, verified and read back by rerun."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("rerun")
from rerun.chunk import RrdReader

from collision_response import Body, Contact, ImpactModel, resolve
from collision_response.recording import Record, Recorder

DEADLINE = 20.0


def rerun(*arguments, **options):
    command = [sys.executable, "-m", "rerun", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False, **options)


def verify(*paths):
    check = rerun("rrd", "verify", *paths)
    assert check.returncode == 0, check.stderr


def static(path, entity, component):
    """The values of a component that are on no timeline."""
    values = []
    for chunk in RrdReader(str(path)).stream().filter(content=entity, components=component).to_chunks():
        batch = chunk.to_record_batch()
        if not {"ros_time", "answer"} & set(batch.schema.names):
            values += batch.column(component).to_pylist()
    return values


def read(path, entity, component, timelines=("ros_time", "answer")):
    """Rows of an entity on exactly these timelines: stamp [ns], number of the answer, value."""
    rows = []
    for chunk in RrdReader(str(path)).stream().filter(content=entity, components=component).to_chunks():
        batch = chunk.to_record_batch()
        if {"ros_time", "answer"} & set(batch.schema.names) == set(timelines):
            times = [batch.column(name).cast("int64").to_pylist() for name in timelines]
            rows += zip(*times, batch.column(component).to_pylist(), strict=True)
    return sorted(rows)


def impact(sequence=1):
    """A ball of 2 kg falls on the floor at 3 m/s; e = 0.5."""
    ball = Body.dynamic(2.0, position=(0.0, 0.0, 0.5), velocity=(1.0, 0.0, -3.0))
    floor = Body.static()
    contact = Contact.of((0.0, 0.0, 0.0), normal=(0.0, 0.0, 2.0), restitution=0.5)
    answer = resolve(ball, floor, contact)
    request = ball, floor, contact, ImpactModel()
    return Record(1_000_000_000 * sequence + 1, sequence, "ball/1", "the floor", *request, answer)


def closed(directory, entries=(), **options):
    """A closed recorder that was given these entries, and the problems it reported."""
    problems = []
    recorder = Recorder(directory, problems.append, **options)
    for entry in entries:
        recorder.add(entry)
    recorder.close()
    return recorder, problems


def recorded(directory, entries):
    """The file of a closed recorder that was given these entries."""
    recorder, problems = closed(directory, entries)
    assert problems == []
    return recorder.path
