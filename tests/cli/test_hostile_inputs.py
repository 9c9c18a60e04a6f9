"""A slice of ``benchmarks/hostile_inputs.py``: inputs made by a grammar, at the real commands."""

import pytest
from hostile_grammar import Case
from hostile_inputs import MENDS, all_cases, nonsense_taken, run, up_to_the_first_computation

GOOD = {
    "data/runs.csv": b"file\na.csv\n",
    "data/a.csv": b"time_s,shear_rate_1_s,stress_Pa\n"
    + b"".join(b"0.%d,1,%d\n" % (i, i) for i in range(1, 9)),
    "s.toml": b'[data]\nfolder = "data"\n',
}


@pytest.fixture(scope="module", params=[25, pytest.param(100, marks=pytest.mark.slow)])
def slice_of_cases(request):
    said = []
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("DISCOVER_DATA", raising=False)
        counts, lines = all_cases(range(request.param), 15, said.append)
    return counts, lines, request.param


def test_hostile_inputs_end_in_a_message_that_helps_or_are_fine(slice_of_cases):
    counts, lines, cases = slice_of_cases
    assert lines == []
    refused = sum(n for (_, verdict), n in counts.items() if verdict == "refused")
    assert refused > 0.3 * cases


def test_sane_ones_among_them_are_taken(slice_of_cases):
    counts, _, cases = slice_of_cases
    accepted = sum(n for (_, verdict), n in counts.items() if verdict == "accepted")
    assert accepted > 0.1 * cases


def test_a_good_study_reaches_the_computation_and_a_good_folder_its_end(tmp_path):
    with up_to_the_first_computation():
        study = run(
            Case("good", ["close-loop", "{}/s.toml", "--out", "{}/out"], dict(GOOD)), tmp_path
        )
    assert study.text == "reached the computation"
    folder = run(Case("good", ["data", "show", "{}/data"], dict(GOOD)), tmp_path)
    assert (folder.verdict, "a.csv" in folder.text) == ("accepted", True)


@pytest.mark.parametrize(
    ("error", "verdict"),
    [(RuntimeError("x"), "exit 1"), (MemoryError(), "exit 1"), (SystemError(), "exit 1")],
)
def test_a_fault_of_the_software_is_seen(tmp_path, monkeypatch, error, verdict):
    def fail(*_):
        raise error

    monkeypatch.setattr("discover.dataset.checking.folder.read_index", fail)
    assert run(Case("bad", ["data", "check", "{}/data"], dict(GOOD)), tmp_path).verdict == verdict


def test_a_hang_is_seen(tmp_path, monkeypatch):
    def wait(*_):
        while True:
            pass

    monkeypatch.setattr("hostile_inputs.SECONDS", 0.3)
    monkeypatch.setattr("discover.dataset.checking.folder.read_index", wait)
    assert run(Case("bad", ["data", "check", "{}/data"], dict(GOOD)), tmp_path).verdict == "hang"


def test_nonsense_that_is_taken_is_seen(tmp_path):
    case = Case("bad", ["data", "show", "{}/data"], dict(GOOD), nonsense=["it is not"])
    assert nonsense_taken(case, run(case, tmp_path)) == ["it is not"]
    assert not MENDS.search("The value is wrong.")
