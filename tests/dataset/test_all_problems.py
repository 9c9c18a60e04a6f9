"""All that is wrong in a data folder is told at once, and what was probably meant."""

import pytest

import discover as dc
from discover.errors import problems_in

GOOD = "time_s,shear_rate_1_s,stress_Pa\n0,1,2\n1,1,3\n2,1,4\n"


def folder_of(tmp_path, **files):
    root = tmp_path / "melt"
    root.mkdir()
    for name, text in files.items():
        (root / f"{name}.csv").write_text(text)
    return root


def test_every_file_and_every_column_is_told_of(tmp_path):
    root = folder_of(
        tmp_path,
        runs="file\na.csv\nb.csv\nc.csv\n",
        a="time_s,shear_rate_1_s,stres_Pa\n0,1,2\n1,y,2\n1,1,3\n",
        b="time_s,shear_rate_1_s,stress_Pa\n0,1,2\n1,1\n2,1,3\n3,1\n4,1,3\n",
        c=GOOD,
        lve="omega_rad_s,Gp_Pa,Gpp_Pa\n1,2,x\n2,-3,4\n",
    )
    with pytest.raises(dc.InputError) as error:
        dc.load_dataset(root)
    problems = problems_in(str(error.value))
    said = ("Is stres_Pa meant", "holds y", "increase strictly", "(Line 5 too.)", "holds x")
    for words in said:
        assert sum(words in one for one in problems) == 1, words
    assert len(problems) == len(said)
    assert not any("c.csv" in one for one in problems)
    assert len([one for one in dc.check_folder(root) if one.severity == "error"]) == len(said)


def test_all_lines_of_one_fault_are_named(tmp_path):
    lines = "".join(f"{i},1,{'x' if i in (3, 5, 9) else 2}\n" for i in range(12))
    root = folder_of(tmp_path, runs="file\na.csv\n", a="time_s,shear_rate_1_s,stress_Pa\n" + lines)
    with pytest.raises(dc.InputError, match=r"line 5 holds x.*\(Lines 7 and 11 too\.\)"):
        dc.load_dataset(root)


def test_a_good_folder_is_read_as_before(tmp_path):
    """Negative control."""
    data = dc.load_dataset(folder_of(tmp_path, runs="file\na.csv\n", a=GOOD))
    assert data["a.csv"].stress.tolist() == [2.0, 3.0, 4.0]


def test_a_folder_a_file_and_a_run_that_are_misspelled_get_a_guess(tmp_path):
    root = folder_of(tmp_path, runs="file\nfast.csv\nslwo.csv\n", fast=GOOD, slow=GOOD)
    with pytest.raises(dc.InputError, match=r"Did you mean 'slow\.csv'"):
        dc.load_dataset(root)
    with pytest.raises(dc.InputError, match="Did you mean 'melt'"):
        dc.load_dataset(tmp_path / "mlet")
    (root / "runs.csv").write_text("file\nfast.csv\nslow.csv\n")
    with pytest.raises(dc.InputError, match=r"Did you mean 'fast\.csv'"):
        dc.load_dataset(root).select(["Fast"])
