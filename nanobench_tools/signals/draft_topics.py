"""Columns of several ROS topics in one table, named ``/topic/field/field`` as PlotJuggler writes them.

Names and types of the topics decide which is the motion capture, the estimate and the set-point, as in a bag.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ..errors import InputError
from ..sources.bag_choice import ODOMETRY, POSES, ROS, Choice, choose, vehicles_in
from ..sources.bag_topics import Topic
from .draft import Draft, Drafted, Key

PLAIN = {"voltage": frozenset({"battery", "batt"})}
"""Field that others have, too -> words of the topics of which it is read."""
POSE_STREAMS = ("mocap", "estimator", "setpoint")


def topics_in(columns: Iterable[str]) -> dict[Topic, dict[str, str]]:
    """Topic -> its field that a message type is known by, such as ``pose.position.x`` -> column."""
    columns = [c for c in columns if c.startswith("/")]
    found: dict[Topic, dict[str, str]] = {}
    for column in columns:
        fits = [Topic(column.removesuffix(tail), kind) for kind, names in ROS.items() for known in names
                if column.endswith(tail := f"/{known.name.replace('.', '/')}") and column != tail]
        whole = [t for t in fits if t.kind == ODOMETRY and _has_twist(t.name, columns)]
        fits = whole or [t for t in fits if t.kind != ODOMETRY]
        if fits:
            topic = max(fits, key=lambda t: len(t.name))
            field = column.removeprefix(f"{topic.name}/").replace("/", ".")
            if PLAIN.get(field, set(topic.words)) & set(topic.words):
                found.setdefault(topic, {})[field] = column
    return found


def _has_twist(topic: str, columns: Iterable[str]) -> bool:
    return any(c.startswith(f"{topic}/twist/twist/") for c in columns)


def name_topics(draft: Draft, values: Mapping[str, np.ndarray]) -> None:
    """Maps the columns of the topics that are chosen. The others are left out with a reason, or asked about."""
    topics = topics_in(values)
    if not topics:
        return
    moved = {t.name: max(float(np.nanmax(v, initial=0.0) - np.nanmin(v, initial=0.0)) for v in (
        values[c] for field, c in fields.items() if field.endswith(("position.x", "position.y", "position.z"))))
        for t, fields in topics.items() if t.kind in POSES and any(".position." in f".{field}" for field in fields)}
    vehicles = vehicles_in(list(topics), moved)
    every = [column for fields in topics.values() for column in fields.values()]
    if len(vehicles) > 1:
        question = f"which vehicle: {', '.join(v.label for v in vehicles)}? write one map for each"
        draft.questions.append(question)
        draft.unknown.update(dict.fromkeys(every, question))
        return
    try:
        choice = choose(list(topics), vehicles[0], {}, "", moved)
    except InputError as error:
        question = f"{error.found}; which is it? write its columns in the stream"
        draft.questions.append(question)
        draft.unknown.update(dict.fromkeys(every, question))
        return
    draft.notes += [sentence for sentence in choice.left if " is taken for " in sentence]
    for topic, fields in topics.items():
        _map(draft, topic, fields, choice)


def _map(draft: Draft, topic: Topic, fields: Mapping[str, str], choice: Choice) -> None:
    stream = next((s for s, t in choice.streams.items() if t.name == topic.name), None)
    for known in ROS[topic.kind]:
        column = fields.get(known.name)
        if column is None:
            continue
        key = None if stream is None or known.what else _key(stream, (known.stream, known.quantity))
        if key is not None:
            draft.mapped.setdefault(key, Drafted(column, known.unit, "known", f"ROS topic {topic.name}"))
        else:
            draft.unknown[column] = known.what or f"of topic {topic.name}, which is not read"


def _key(stream: str, key: Key) -> Key | None:
    """The quantity of a message in the stream that its topic is for. None where that has no such quantity."""
    if stream not in POSE_STREAMS:
        return key
    last = key[1][-1]
    if key[1].startswith("q"):
        return {"mocap": ("mocap", f"q{last}"), "estimator": ("attitude_qw", f"q{last}")}.get(stream)
    return stream, f"p{last}" if stream == "mocap" else last
