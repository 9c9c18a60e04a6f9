"""Values of study files: strict types, and files planted in their place."""

import os
import socket
import time

import pytest

from discover.errors import InputError
from discover.study import RunFolder, parse_study, read_study
from discover.study.atomic import LOCK_FILE


def study(**sections):
    return parse_study({"data": {"folder": "melt"}} | sections)


OF_ANOTHER_KIND = {
    "model": [("modulus_Pa", True), ("modulus_Pa", "3"), ("parameters", {"alpha": True})],
    "loop": [("max_effects", True), ("max_effects", 2.0), ("noise", True), ("strain", [False, 1])],
    "compare": [("quick", 1), ("quick", "yes"), ("seed", "7")],
}


@pytest.mark.parametrize("section", OF_ANOTHER_KIND)
def test_a_value_of_another_kind_is_refused_with_its_name(section):
    for name, value in OF_ANOTHER_KIND[section]:
        with pytest.raises(InputError, match=rf"{section}\.{name}.*should be.*; got"):
            study(**{section: {name: value}})
    # the control: whole numbers and truth values are what they are
    right = study(
        model={"law": "giesekus", "modulus_Pa": 3, "parameters": {"alpha": 0}},
        compare={"quick": True}, loop={"strain": [0, 25]}, data={"folder": "a", "held_out": []},
    )  # fmt: skip
    assert (right.model.modulus_Pa, right.model.parameters["alpha"]) == (3.0, 0.0)
    assert (right.compare.quick, right.loop.strain) == (True, (0.0, 25.0))
    assert right.data.held_out == ()


@pytest.mark.parametrize(
    ("text", "reason"),
    [(".".join(["a"] * 300_000) + " = 1", "dots on line 1"), ("." * 900_000, "dots on line 1"),
     ("[[" + " . ".join(["a"] * 150_000), "dots on line 1"),
     ('"' + '\\"' * 400_000, "not valid TOML"), ('"""' + '\\"' * 400_000, "not valid TOML")],
    ids=["key", "dots", "header", "string", "lines"],
)  # fmt: skip
def test_an_endless_key_or_string_is_refused_at_once(tmp_path, text, reason):
    path = tmp_path / "study.toml"
    path.write_text(text)
    begun = time.process_time()
    with pytest.raises(InputError, match=reason):
        read_study(path)
    assert time.process_time() - begun < 2.0


def test_dots_in_values_are_no_parts_of_a_key(tmp_path):
    path = tmp_path / "good.toml"
    name = ".".join(["run"] * 50) + ".csv"
    path.write_text(f'[data]\nfolder = "."\nfit = ["{name}"]\n')
    assert read_study(path).data.fit == (name,)


@pytest.mark.parametrize("kind", ["pipe", "link", "folder", "socket"])
def test_a_lock_that_is_no_plain_file_is_refused_at_once(tmp_path, kind, monkeypatch):
    lock = tmp_path / LOCK_FILE
    if kind == "socket":
        monkeypatch.chdir(tmp_path)  # an address has no room for a long path
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(LOCK_FILE)
    elif kind == "pipe":
        os.mkfifo(lock)
    elif kind == "link":
        lock.symlink_to(tmp_path / "elsewhere")
    else:
        lock.mkdir()
    with pytest.raises(InputError, match="cannot be written to"):
        RunFolder(tmp_path, "abc")
    assert not (tmp_path / "elsewhere").exists()


def test_a_lock_left_behind_is_taken_over_and_a_folder_for_results_may_be_a_link(tmp_path):
    (tmp_path / LOCK_FILE).write_text('{"pid": 1, "host": "another"}')
    assert not RunFolder(tmp_path, "abc").complete
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    # with half characters, as old disks have them in latin-1
    title = f"<title>{os.fsdecode(bytes([109, 233, 108]))}</title>"
    RunFolder(tmp_path / "out", "abc").write("report.html", title)
    written = (tmp_path / "disk" / "report.html").read_text("utf-8")
    assert written == "<title>m\\udce9l</title>"


RESULTS = {"report.html": "<p>page</p>", "loop.json": '{"verdict": "unexplained"}',
           "figures/run.svg": "<svg/>"}  # fmt: skip


def finished(out):
    folder = RunFolder(out, "abc")
    for name, text in RESULTS.items():
        folder.write(name, text)
    folder.finish()
    return out


def holds(out):
    folder = RunFolder(out, "abc")
    return folder.complete and folder.holds("report.html", "loop.json")


COMPLETE = '{"fingerprint": "abc", "complete": true}'


@pytest.mark.parametrize(
    ("name", "text"),
    [("report.html", ""), ("report.html", "<p>pa"), ("report.html", None),
     ("loop.json", '{"content": {}}'), ("loop.json", "{}"), ("figures/run.svg", ""),
     ("state/study.json", COMPLETE)],
)  # fmt: skip
def test_a_result_that_was_damaged_removed_or_planted_is_made_again(tmp_path, name, text):
    assert holds(finished(tmp_path))
    (tmp_path / name).unlink()
    assert not holds(tmp_path)
    os.mkfifo(tmp_path / name) if text is None else (tmp_path / name).write_text(text)
    assert not holds(tmp_path)
    (tmp_path / name).unlink()
    assert holds(finished(tmp_path))
