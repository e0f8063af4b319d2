from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.example_records import RECORD, some

from onedemo.bench.episodes.episode_records import RecordWriter, RunBusy, encoded, locked, read_records


def written(path, records):
    writer = RecordWriter(path)
    for record in records:
        writer.append(record)
    writer.close()


def test_what_is_appended_is_read_back(tmp_path):
    path = tmp_path / "episodes.jsonl"
    written(path, some(3))
    written(path, [replace(RECORD, index=9, detail='a "quoted"\nline, ünïcode')])
    records, foreign = read_records(path)
    assert [record.index for record in records] == [0, 1, 2, 9]
    assert records[3].detail == 'a "quoted"\nline, ünïcode'
    assert foreign == []
    assert read_records(tmp_path / "none.jsonl") == ([], [])


def test_a_file_cut_at_any_byte_heals(tmp_path):
    whole, path = b"".join(encoded(record) for record in some(3)), tmp_path / "episodes.jsonl"
    first = len(encoded(some(1)[0]))
    for cut in range(first, len(whole)):
        path.write_bytes(whole[:cut])
        complete = whole[:cut].count(b"\n")
        assert len(read_records(path)[0]) == complete
        written(path, [replace(RECORD, index=50)])
        records, foreign = read_records(path)
        assert [record.index for record in records] == [*range(complete), 50]
        assert foreign == []


def test_every_damaged_byte_is_noticed(tmp_path):
    lines, path = [encoded(record) for record in some(3)], tmp_path / "episodes.jsonl"
    for position in range(0, len(lines[1]) - 1):
        damaged = bytearray(lines[1])
        damaged[position] ^= 1
        if damaged[position] == 10:
            continue
        path.write_bytes(lines[0] + bytes(damaged) + lines[2])
        records, foreign = read_records(path)
        assert foreign == [2], bytes(damaged[max(0, position - 5) : position + 5])
        assert [record.index for record in records] == [0, 2]


def test_a_folder_belongs_to_one_process(tmp_path):
    code = (
        "import sys; from pathlib import Path; from onedemo.bench.episodes.episode_records import RunBusy, locked\n"
        "try:\n    with locked(Path(sys.argv[1])): print('free')\nexcept RunBusy as busy: print(busy)"
    )
    run = [sys.executable, "-c", code, str(tmp_path)]
    with locked(tmp_path):
        held = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    assert "another run is writing here" in held
    assert subprocess.run(run, capture_output=True, text=True, check=True).stdout == "free\n"
    with locked(tmp_path), pytest.raises(RunBusy), locked(tmp_path):
        pass


def test_a_full_disk_leaves_the_last_complete_record(tmp_path):
    code = """
import resource, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from helpers.example_records import some
from onedemo.bench.episodes.episode_records import RecordWriter
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1200, 1200))
writer = RecordWriter(Path(sys.argv[1]))
try:
    for record in some(10):
        writer.append(record)
except OSError as error:
    print(error.strerror)
"""
    path = tmp_path / "episodes.jsonl"
    run = [sys.executable, "-c", code, str(path), str(Path(__file__).parents[2])]
    assert subprocess.run(run, capture_output=True, text=True, check=True).stdout == "File too large\n"
    assert path.read_bytes().endswith(b"}\n")
    records, foreign = read_records(path)
    assert 1 <= len(records) < 10
    assert foreign == []
