"""Copy a database of ROS 2 with one topic more."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from kineme.errors import DataError
from kineme.files.ros.added_topic import TEXT, AddedTopic


def copy_sqlite(source: Path, target: Path, added: AddedTopic) -> None:
    """Write a copy of a database with a topic more, in the columns that its version has.

    Raises
    ------
    DataError
        The database refuses it.
    """
    shutil.copyfile(source, target)
    about = {"name": added.name, "type": TEXT, "serialization_format": "cdr", "offered_qos_profiles": ""}
    meaning = {"topic_type": TEXT, "encoding": "ros2msg", "encoded_message_definition": added.definition}
    digest = {"type_description_hash": added.digest}
    try:
        with closing(sqlite3.connect(target)) as database, database:
            (last,) = database.execute("SELECT max(id) FROM topics").fetchone()
            topic = (last or 0) + 1
            _insert(database, "topics", {"id": topic, **about, **digest})
            if _columns(database, "message_definitions"):
                known = "SELECT 1 FROM message_definitions WHERE topic_type = ?"
                if not database.execute(known, (TEXT,)).fetchone():
                    _insert(database, "message_definitions", meaning | digest)
            rows = ((topic, stamp, raw) for stamp, raw in added.messages)
            database.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    except sqlite3.Error as error:
        raise DataError(f"expected a database of ROS 2 that takes another topic, got: {error}") from error


def _insert(database: sqlite3.Connection, table: str, values: Mapping[str, Any]) -> None:
    known = _columns(database, table)
    taken = {name: value for name, value in values.items() if name in known}
    marks = ", ".join("?" * len(taken))
    database.execute(f"INSERT INTO {table} ({', '.join(taken)}) VALUES ({marks})", tuple(taken.values()))


def _columns(database: sqlite3.Connection, table: str) -> set[str]:
    return {str(row[1]) for row in database.execute(f"PRAGMA table_info({table})")}
