"""The journal: entries come back as they were, and only as they were."""

import pytest

from softgym_mj.exceptions import StoreError
from softgym_mj.storage.journal import Journal
from softgym_mj.storage.store import JSON, Store

ENTRIES = [[0.1 + 0.2, -1e-300], [], {"a": None}]


@pytest.fixture(name="file")
def _file(tmp_path):
    journal = Journal(tmp_path / "work.jsonl", "mine")
    assert journal.read() == []
    for entry in ENTRIES:
        journal.append(entry)
    return tmp_path / "work.jsonl"


def test_entries_come_back_and_go_on(file):
    journal = Journal(file, "mine")
    assert journal.read() == ENTRIES
    journal.append("more")
    assert Journal(file, "mine").read() == [*ENTRIES, "more"]


def test_who_was_killed_goes_on_from_the_last_whole_entry(file):
    content = file.read_bytes()
    for length in range(len(content)):
        file.write_bytes(content[:length])
        journal = Journal(file, "mine")
        kept = journal.read()
        assert len(kept) == max(0, content[:length].count(b"\n") - 1)
        for entry in ENTRIES[len(kept) :]:
            journal.append(entry)
        assert file.read_bytes() == content


def test_a_line_that_is_no_json(file):
    first, *lines = file.read_bytes().splitlines(keepends=True)
    file.write_bytes(first + b"".join([lines[0], lines[1][1:], lines[2]]))
    with pytest.raises(StoreError, match=r"work\.jsonl cannot be read"):
        Journal(file, "mine").read()


def test_journals_of_other_keys_and_specifications(tmp_path):
    store = Store(tmp_path, {"task": "rope"}, JSON)
    store.journal((801, 0)).read()
    for other in (store.journal((800, 0)), Store(tmp_path, {"task": "b"}, JSON).journal((801, 0))):
        file = store.file((801, 0)).with_suffix(".jsonl")
        other._file.write_bytes(file.read_bytes())
        with pytest.raises(StoreError, match="belongs to other work"):
            other.read()
