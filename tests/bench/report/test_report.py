"""Reports of run folders: what they say, that they say it again, and that nobody's words run in them."""

from __future__ import annotations

import csv
import json
import re
import threading
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer
from types import SimpleNamespace
from urllib.parse import unquote

import numpy as np
import pytest
from helpers.example_runs import GOLDEN, changed, small_run, with_words
from helpers.pages import Page, browse, needs_browser, needs_nothing_else, same_numbers, screenshot

from onedemo.bench.atomic_files import sha256_of
from onedemo.bench.document.untrusted_text import csv_text, markdown_text, plain, slug
from onedemo.bench.episodes.episode_records import FILE, encoded, read_records
from onedemo.bench.episodes.failure_selection import Video, chosen, video_of, videos_in
from onedemo.bench.episodes.run_folder import table_hash
from onedemo.bench.episodes.scenarios import read_suite
from onedemo.bench.method_table import LOOKS, look_of
from onedemo.bench.report.outcome_figures import timing_ticks
from onedemo.bench.report.rate_figures import Series
from onedemo.bench.report.read_runs import merged, peak_speed, read_run, speeds_of
from onedemo.bench.report.report import write_report, write_report_of
from onedemo.bench.report.tables import number, p_words
from onedemo.bench.workers.dispatcher import ERROR, HUNG, WORKER_DIED
from onedemo.configs.errors import BadConfig
from onedemo.configs.run_config import RunConfig

HOSTILE = [
    "<script>document.title = 'ours'</script>",
    "<img src=x onerror=\"document.title='ours'\">",
    "[link](javascript:alert(1)) | javascript:alert(1)",
    "</style></title><svg onload=alert(1)>",
    "\u202etxt.exe \x00 \x1b[31m `code` # title\n# title",
    "=HYPERLINK(\"http://x\")",
    "y" * 10**6,
]  # fmt: skip
EMPTY = json.dumps({"version": 1, "suite": sha256_of([]), "scenarios": []})
ODD = '{"version": 1, "run": "", "cells": [{"label": "", "config": {"name": "a", "task": "b", "episodes": true}}]}'


def test_the_report_is_the_golden_one(run):
    """Renew it with `PYTHONPATH=tests python -m helpers.example_runs`, and read what has changed."""
    assert (run / "report.md").read_text(encoding="utf-8") == GOLDEN.read_text(encoding="utf-8")


def test_a_report_written_again_has_the_same_bytes(run):
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    assert {path.suffix for path in before} >= {".png", ".pdf", ".md", ".html", ".csv"}
    write_report(run)
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


def test_the_page_needs_nothing_besides_itself(run):
    text = (run / "report.html").read_text(encoding="utf-8")
    assert needs_nothing_else(Page(text), run)
    assert len(text) < 3_000_000


def test_both_reports_hold_the_same_numbers(run):
    page = Page((run / "report.html").read_text(encoding="utf-8"))
    assert same_numbers(page, (run / "report.md").read_text(encoding="utf-8"))


@pytest.mark.parametrize("words", HOSTILE, ids=range(len(HOSTILE)))
def test_words_of_others_stay_words(tmp_path, words):
    folder = with_words(small_run(tmp_path / "run", 3, levels=("L4",), methods=("screw", "rrt")), words)
    write_report(folder)
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert not {"script", "svg", "iframe", "object", "link"} & {tag for tag, _ in page.tags}
    for _, attributes in page.tags:
        assert not any(name.startswith("on") for name in attributes)
        assert "javascript:" not in " ".join(str(value) for value in attributes.values())
    assert len(text) < 1_500_000
    report = (folder / "report.md").read_text(encoding="utf-8")
    assert len(report) < 30_000
    assert report.count("```") == 2
    outside = "".join(report.split("```")[::2])
    assert "<script" not in outside.replace("\\<", "")
    assert "](javascript" not in outside.replace("\\]", "")
    assert "\n# title" not in outside
    assert not any(c in report + text for c in "\u202e\x00\x1b")
    widths = {len(row) for row in csv.reader((folder / "episodes.csv").open(encoding="utf-8"))}
    assert len(widths) == 1
    for row in csv.DictReader((folder / "episodes.csv").open(encoding="utf-8")):
        assert not row["detail"].startswith("=")


@needs_browser
def test_nothing_runs_and_nothing_is_asked_for_in_a_browser(tmp_path):
    asked = []

    class Listener(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Listener)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{server.server_port}/"
    tail = "<script>document.title='ours'</script>"
    words = f"<script src='{url}s'></script><img src='{url}i' onerror=\"document.title='ours'\">{tail}"
    folder = with_words(small_run(tmp_path / "run", 3, levels=("L4",), methods=("screw", "rrt")), words)
    write_report(folder)
    try:
        (tmp_path / "asks.html").write_text(f"<img src='{url}control'><script>document.title='ran'</script>")
        control = browse(tmp_path / "asks.html", tmp_path / "profile", "--dump-dom").stdout
        dom = browse(folder / "report.html", tmp_path / "profile", "--dump-dom").stdout
    finally:
        server.shutdown()
    assert "<title>ran</title>" in control, "the browser would have run a script"
    assert asked == ["/control"], "and would have asked"
    assert "<title>synthetic: 2 cells, 6 episodes</title>" in dom
    assert "<script" not in dom


@needs_browser
@pytest.mark.parametrize("width, height", [(390, 844), (1280, 900)])
def test_the_page_is_drawn_on_a_phone_and_on_a_desk(run, tmp_path, width, height):
    pixels = screenshot(run / "report.html", tmp_path, width, height)
    assert pixels.shape == (height, width, 3)
    colored = np.ptp(pixels, axis=2) > 40
    assert 0.001 < colored.mean() < 0.5, "bars and figures, on white"
    assert (pixels.min(axis=2) < 100).mean() > 0.005, "letters"
    assert (pixels[:, :8] > 240).all(), "a margin"


def test_runs_of_the_same_scenarios_are_compared_and_others_refused(tmp_path):
    ours = small_run(tmp_path / "ours", methods=("screw",))
    theirs = small_run(tmp_path / "theirs", methods=("replay",), levels=("L1", "L4"))
    files = write_report_of([ours, theirs], tmp_path / "both")
    text = files[0].read_text(encoding="utf-8")
    assert "| setting | n | screw | replay |" in text
    assert "Paired tests against screw" in text
    assert "onedemo run ours/config.yaml\nonedemo run theirs/config.yaml" in text
    other = small_run(tmp_path / "other", methods=("replay",), seed=1)
    with pytest.raises(BadConfig) as refused:
        write_report_of([ours, other], tmp_path / "both")
    hashes = [read_suite(folder).hash[:12] for folder in (ours, other)]
    assert str(refused.value).count("\n") == 0
    assert all(f"{each}" in str(refused.value) for each in (*hashes, ours, other))


def test_of_an_episode_in_two_runs_the_first_counts_and_a_difference_is_said(tmp_path):
    first, second = small_run(tmp_path / "a"), small_run(tmp_path / "b")
    same = merged([read_run(first), read_run(second)])
    assert table_hash(same.every) == table_hash(read_run(first).every)
    assert same.warnings == ()
    changed(second, lambda record: replace(record, success=not record.success, wall_seconds=9.0))
    again = merged([read_run(first), read_run(second)])
    assert table_hash(again.every) == table_hash(same.every)
    assert len(again.warnings) == 6
    assert "12 episodes" in again.warnings[0]


def test_the_hash_of_results_knows_no_clock_and_no_order(tmp_path):
    one = read_run(small_run(tmp_path / "a"))
    slower = changed(
        small_run(tmp_path / "b"), lambda record: replace(record, wall_seconds=7.0, tick_us=[1.0, 2.0, 3.0])
    )
    lines = (slower / FILE).read_bytes().splitlines(keepends=True)
    (slower / FILE).write_bytes(b"".join(reversed(lines)))
    assert table_hash(read_run(slower).every) == table_hash(one.every)
    other = changed(slower, lambda record: replace(record, seconds=record.seconds + 1e-6))
    assert table_hash(read_run(other).every) != table_hash(one.every)


@pytest.mark.parametrize(
    "file, content, message",
    [
        ("cells.json", "[]", "cells.json: is not a list of cells"),
        ("cells.json", "{", "cells.json: is not a list of cells"),
        ("cells.json", None, "cells.json: cannot be read: No such file or directory; is this a run folder?"),
        ("cells.json", '{"version": 1, "run": "", "cells": []}', "cells.json: cells: is empty"),
        ("cells.json", '{"version": 9}', "cells.json: version: is 9; known: 1"),
        ("cells.json", ODD, "cells.json: is not a list of cells"),
        ("scenarios.json", "[]", "scenarios.json: is not a list of scenarios"),
        ("scenarios.json", None, "scenarios.json: is missing: the run has not begun"),
        ("scenarios.json", EMPTY, "scenarios.json: scenarios: are not those of the cells"),
        ("environment.json", "3", "environment.json: does not hold a table"),
    ],
)  # fmt: skip
def test_a_folder_that_cannot_be_used_is_refused_in_one_line(tmp_path, file, content, message):
    folder = small_run(tmp_path / "run", 2)
    if content is None:
        (folder / file).unlink()
    else:
        (folder / file).write_text(content)
    with pytest.raises(BadConfig) as refused:
        write_report(folder)
    assert message in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_a_run_in_parts_is_read_like_a_whole_one(tmp_path):
    folder = small_run(tmp_path / "run")
    whole = table_hash(read_run(folder).every)
    lines = (folder / FILE).read_bytes().splitlines(keepends=True)
    for k in range(3):
        (folder / f"episodes.{k + 1}-of-3.jsonl").write_bytes(b"".join(lines[k::3]))
    (folder / FILE).unlink()
    assert table_hash(read_run(folder).every) == whole


def test_damaged_lines_and_strangers_are_passed_over_and_named(tmp_path):
    folder = small_run(tmp_path / "run", levels=("L1",), methods=("screw",))
    records, _ = read_records(folder / FILE)
    lines = (folder / FILE).read_bytes().splitlines(keepends=True)
    odd = encoded(replace(records[3], metrics={"tilt": "high"}))
    extra = [replace(records[0], index=99), replace(records[0], cell="f" * 12), records[0]]
    whole = b"".join([*lines[:3], odd, *lines[4:], b"garbage\n", *(encoded(each) for each in extra), b'{"crc":1,"rec'])
    (folder / FILE).write_bytes(whole)
    run = read_run(folder)
    assert [record.index for record in run.every] == [k for k in range(12) if k != 3]
    assert run.warnings == (
        "episodes.jsonl, line 13: not an episode record, skipped",
        "episodes.jsonl, line 14: an episode of another run, skipped",
        "episodes.jsonl, line 15: an episode of another run, skipped",
        "episodes.jsonl, line 17: torn, its episode is run again",
        "1 records hold values of other types and were passed over",
    )
    (folder / FILE).write_bytes(whole + b"\n" * 30)
    assert len(read_run(folder).warnings) == 12
    assert str(tmp_path) not in write_report(folder)[0].read_text(encoding="utf-8")


def test_an_unfinished_run_has_a_report_that_says_so(tmp_path):
    folder = small_run(tmp_path / "run", 5)
    lines = (folder / FILE).read_bytes().splitlines(keepends=True)
    (folder / FILE).write_bytes(b"".join(lines[:7]))
    text = write_report(folder)[0].read_text(encoding="utf-8")
    assert "Unfinished: 23 of the planned episodes are missing." in text
    assert "2 of 5" in text
    (folder / FILE).write_bytes(b"")
    assert "0 episodes" in write_report(folder)[0].read_text(encoding="utf-8")


def test_lost_episodes_are_failures_with_names_and_without_times(tmp_path):
    folder = small_run(tmp_path / "run", 4, levels=("L1",), methods=("screw",))
    reasons = [WORKER_DIED, HUNG, ERROR, HUNG]

    def lost(record):
        seconds = 0.0 if record.index < 3 else 60.0
        ticks = [0.0] * 4 if record.index < 3 else [1.0, 2.0, 3.0, 4.0]
        reason = reasons[record.index]
        return replace(
            record, success=False, failure_reason=reason, seconds=seconds, tick_us=ticks, metrics={}, clearance=None
        )

    text = write_report(changed(folder, lost))[0].read_text(encoding="utf-8")
    for words in ("worker died", "worker hung", "error of the policy", "timeout"):
        assert f"| screw | {words} |" in text
    assert "| stack | Panda | screw | 0.0010 | 0.0020 | 0.0030 |" in text
    assert [record.index for record in chosen(read_run(folder).every)] == [2, 3], "what was lost is not filmed"


def test_a_method_looks_the_same_in_every_report():
    looks = [(look.color, look.marker, look.line) for look in LOOKS.values()]
    assert len(set(looks)) == len(looks)
    assert look_of("screw") == LOOKS["screw"]
    assert look_of("mine") == look_of("mine")


@pytest.mark.parametrize(
    "task, env, milliseconds", [("stack", {}, 20), ("reach", {}, 50), ("stack", {"control_frequency": 25}, 40)]
)
def test_a_tick_is_as_long_as_the_task_has_it(task, env, milliseconds):
    cell = RunConfig(name="x", task=task, method="screw", demonstration="stack", env=env)
    (drawn,) = timing_ticks([Series("screw", "screw", [SimpleNamespace(cell=cell)])])
    assert drawn == pytest.approx(milliseconds)


def test_speeds_are_those_of_the_drawn_obstacles(tmp_path):
    suite = read_run(small_run(tmp_path / "run")).suite
    speeds = speeds_of(suite)
    assert [each["level"] for each in suite.scenarios if each["fingerprint"] in speeds] == ["L4"] * 12
    swinging = next(each for each in suite.scenarios if each["level"] == "L4" and speeds[each["fingerprint"]])
    frequency = swinging["start"]["obstacles"][0]["frequency"]
    assert speeds[swinging["fingerprint"]] == pytest.approx(0.1 * frequency)
    assert peak_speed({"long": [0.0, 0.1, 0.0], "short": [0.0, 0.0, 0.2], "frequency": 2.0}) == pytest.approx(0.4)
    assert peak_speed("x") == peak_speed({"long": "x", "frequency": 1}) == 0.0


def test_videos_are_of_the_first_failure_of_each_kind_of_each_method(run):
    records = read_run(run).every
    few, many = chosen(records, 3), chosen(records, 100)
    assert few == many[:3]
    assert len({record.method for record in few}) == 3
    kinds = {(record.method, record.failure_reason) for record in records if not record.success}
    assert {(record.method, record.failure_reason) for record in many} == kinds
    assert len(many) == len(kinds)
    for record in many:
        same = (r for r in records if (r.method, r.failure_reason) == (record.method, record.failure_reason))
        assert next(r for r in same if not r.success) == record


def test_a_video_is_linked_from_its_failure(tmp_path):
    folder = small_run(tmp_path / "run")
    records = read_run(folder).every
    record = chosen(records)[0]
    video = video_of(record)
    (folder / "videos").mkdir()
    (folder / video.file).touch()
    (folder / "videos" / "javascript:alert(1).mp4").touch()
    assert videos_in(folder) == [Video(record.cell, record.index, record.seed, record.failure_reason, video.file)]
    text = write_report(folder)[0].read_text(encoding="utf-8")
    assert text.count("[video](videos/") == 1
    assert f"[video]({video.file})" in text
    assert f'href="{video.file}"' in (folder / "report.html").read_text(encoding="utf-8")


def filmed_run(folder, **options):
    """A run with an empty video of its first failure, and its path from the folder."""
    small_run(folder, **options)
    video = video_of(chosen(read_run(folder).every)[0])
    (folder / "videos").mkdir()
    (folder / video.file).touch()
    return folder, video.file


@pytest.mark.parametrize("name", ["theirs", "a run's (2nd) [x] & 50% \u00fc"])
def test_a_report_of_several_runs_leads_to_the_videos_of_all(tmp_path, name):
    ours, one = filmed_run(tmp_path / "ours", methods=("screw",))
    theirs, other = filmed_run(tmp_path / name, methods=("replay",))
    for output, way in ((tmp_path / "reports" / "both", "../../"), (ours, "../")):
        files = write_report_of([ours, theirs], output)
        page = Page(files[1].read_text(encoding="utf-8"))
        links = [each["href"] for tag, each in page.tags if tag == "a" and each["href"].endswith(".mp4")]
        assert {(output / unquote(link)).resolve() for link in links} == {ours / one, theirs / other}
        assert one in links[0] if output == ours else links[0] == f"{way}ours/{one}"
        assert all(f"[video]({link})" in files[0].read_text(encoding="utf-8") for link in links)
        assert all(re.fullmatch(r"[A-Za-z0-9_./%-]+", link) for link in links)


def test_of_an_episode_in_two_runs_the_first_video_is_linked(tmp_path):
    ours, file = filmed_run(tmp_path / "ours", methods=("screw",))
    again, _ = filmed_run(tmp_path / "again", methods=("screw",))
    text = write_report_of([ours, again], tmp_path / "both")[0].read_text(encoding="utf-8")
    assert f"[video](../ours/{file})" in text and "../again/" not in text


def test_first_episodes_of_several_runs_are_shown_with_their_folders(tmp_path):
    folders = [small_run(tmp_path / name, methods=(name,)) for name in ("screw", "replay")]
    for folder in folders:
        (folder / "showcase.json").write_text(json.dumps({"video": True, "speed": 4.0, "video_problem": ""}))
        (folder / "episode0.png").write_bytes(b"PNG")
        (folder / "episode0.mp4").touch()
    (folders[1] / "showcase.json").write_text(json.dumps({"video": True, "video_problem": "no ffmpeg"}))
    files = write_report_of(folders, tmp_path / "both")
    text, page = (file.read_text(encoding="utf-8") for file in files[:2])
    assert "(../screw/episode0.png)" in text and "(../replay/episode0.png)" in text
    assert "[episode0.mp4](../screw/episode0.mp4)" in text and "(../replay/episode0.mp4)" not in text
    assert "No video of replay: no ffmpeg." in text
    assert text.count("## The first episode") == 1 and 'href="../screw/episode0.mp4"' in page
    alone = write_report(folders[0])[0].read_text(encoding="utf-8")
    assert "[episode0.mp4](episode0.mp4)" in alone and "of screw" not in alone


def test_tables_hold_every_episode_and_every_cell(run):
    with (run / "episodes.csv").open(encoding="utf-8") as file:
        episodes = list(csv.DictReader(file))
    with (run / "summary.csv").open(encoding="utf-8") as file:
        cells = list(csv.DictReader(file))
    assert len(episodes) == 144
    assert len(cells) == 12
    for cell in cells:
        own = [row for row in episodes if row["cell"] == cell["cell"]]
        safe = sum(row["success"] == row["safe"] == "1" for row in own)
        assert safe == int(cell["safe_successes"])
        assert float(cell["safe_success_rate"]) == pytest.approx(safe / 12)
        assert float(cell["safe_success_low"]) <= safe / 12 <= float(cell["safe_success_high"])
        assert float(cell["tick_us_max"]) == pytest.approx(max(float(row["tick_us_max"]) for row in own), rel=1e-3)


@pytest.mark.parametrize(
    "value, text",
    [(0.0, "0"), (0.012345, "0.0123"), (1.2345, "1.23"), (12.345, "12.3"), (123.45, "123"), (-0.5, "-0.500"),
     (1e-9, "0.0000"), (float("nan"), "–"), (99.96, "100")],
)  # fmt: skip
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


def test_small_pieces_of_text():
    assert p_words(0.0004) == "< 0.001"
    assert p_words(0.04) == "0.040"
    assert p_words(float("nan")) == "–"
    assert plain("a\x00\n b\u2028c") == "a b c"
    assert len(plain("z" * 10**7)) == 300
    assert markdown_text("a|b") == "a\\|b"
    assert csv_text("+1") == "'+1"
    assert slug("../../Etc passwd<>") == "etc-passwd"
    assert slug("***") == "unnamed"
