"""Run folders for tests of reports."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from onedemo.bench.episodes.episode_records import FILE, EpisodeRecord, encoded, read_records
from onedemo.bench.episodes.synthetic_runs import write_synthetic_run
from onedemo.bench.report.report import write_report

GOLDEN = Path(__file__).parents[1] / "bench" / "golden_report.md"


def small_run(folder, episodes=12, **options):
    """A run of one task, two levels and three methods."""
    chosen = {"tasks": ("stack",), "levels": ("L1", "L4"), "methods": ("screw", "replay", "rrt"), **options}
    return write_synthetic_run(folder, episodes, **chosen)


def changed(folder, change):
    """The run with each record changed."""
    records, _ = read_records(folder / FILE)
    (folder / FILE).write_bytes(b"".join(encoded(change(record)) for record in records))
    return folder


def with_words(folder, words):
    """The run with these words wherever others may have written some."""

    def change(record: EpisodeRecord) -> EpisodeRecord:
        return replace(record, stage=words, detail=words, collision=words, failure_reason=words, success=False)

    environment = {"python": words, "commit": words, "packages": {words: words}, words: words, "command": words}
    (folder / "environment.json").write_text(json.dumps(environment))
    return changed(folder, change)


if __name__ == "__main__":  # renews the golden file; read the difference before you commit it
    import tempfile

    with tempfile.TemporaryDirectory() as place:
        run = small_run(Path(place) / "run", tasks=("stack", "pour"))
        write_report(run)
        GOLDEN.write_text((run / "report.md").read_text(encoding="utf-8"), encoding="utf-8")
