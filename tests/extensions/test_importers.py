"""An importer, one file outside the package, as its page describes it."""

import shlex

import numpy as np
import pytest
from user_packages import blocks

from discover.dataset import load_dataset
from discover.dataset.importing import IMPORTERS, Block, register_importer
from discover.errors import InputError

PAGE = "adding-a-loader.md"


def archives(folder):
    time = np.linspace(0.0, 2.0, 30)
    for number in (1, 2):
        torque = number * (1.0 - np.exp(-time))
        np.savez(
            folder / f"run{number}.npz", milliseconds=1e3 * time, rate=np.full(30, float(number)),
            torque=torque,
        )  # fmt: skip
    return time


def commands():
    return [shlex.split(line)[1:] for line in blocks(PAGE, "sh")[0].splitlines()]


@pytest.mark.slow
def test_the_importer_of_the_page_makes_a_folder_that_loads(workplace):
    workplace.follow(PAGE)
    time = archives(workplace.folder)
    for command in commands():
        workplace.run(*command)
    data = load_dataset(str(workplace.folder / "melt"))
    assert [run.name for run in data] == ["run1.csv", "run2.csv"]
    np.testing.assert_allclose(data[1].time, time)
    np.testing.assert_allclose(data[1].rate, 2.0)
    # cone and plate: stress = 3 M / (2 pi R^3)
    stress = 3 * 2e-6 * (1.0 - np.exp(-time)) / (2 * np.pi * 0.0125**3)
    np.testing.assert_allclose(data[1].stress, stress)


@pytest.mark.slow
def test_the_format_is_kept_with_the_import_so_that_it_can_be_repeated(workplace):
    workplace.follow(PAGE)
    archives(workplace.folder)
    (workplace.folder / "run1.npz").rename(workplace.folder / "run1.raw")
    first = ["data", "import", "run1.raw", "--format", "house_rheometer"]
    first += ["--geometry", "cone_plate:radius_mm=12.5,angle_deg=1", "--out", "melt"]
    workplace.run(*first)
    workplace.run("data", "import", "--mapping", "melt/import.toml", "--out", "again")
    one, other = (workplace.folder / name / "run1.csv" for name in ("melt", "again"))
    assert one.read_text() == other.read_text()


@pytest.mark.slow
def test_a_file_that_the_importer_cannot_read_is_refused(workplace):
    workplace.follow(PAGE)
    (workplace.folder / "run1.npz").write_bytes(b"nothing of the kind")
    np.savez(workplace.folder / "run2.npz", milliseconds=np.zeros(3))
    for name, why in (("run1", "ValueError"), ("run2", "KeyError")):
        done = workplace.run("data", "import", f"{name}.npz", "--out", "melt", code=2)
        assert f"The importer 'house_rheometer' cannot read {name}.npz ({why}" in done.stderr
    assert not (workplace.folder / "melt").exists()


@pytest.mark.slow
def test_without_the_package_the_commands_of_the_page_are_refused(workplace):
    # negative control of the first test
    archives(workplace.folder)
    workplace.run(*commands()[0], code=2)
    done = workplace.run(*commands()[0], "--format", "house_rheometer", code=2)
    assert (
        "Unknown format 'house_rheometer'. Write one of: text, spreadsheet, reptate." in done.stderr
    )


def test_a_name_or_a_suffix_is_not_given_twice():
    def read(path):
        return [Block.of({"time": ("s", [0.0])})]

    register_importer("mine", read, [".raw"])
    try:
        with pytest.raises(InputError, match="known already"):
            register_importer("mine", read)
        with pytest.raises(InputError, match=r"end in \.raw are read by the importer 'mine'"):
            register_importer("other", read, [".RAW"])
        with pytest.raises(InputError, match="known already"):
            register_importer("text", read)
    finally:
        del IMPORTERS["mine"]


def test_columns_of_a_block_have_one_length_and_a_gap_is_an_empty_cell():
    block = Block.of({"time": ("s", [0.0, 1.0]), "stress": ("kPa", [np.nan, 2.5])}, "step 1")
    assert block.cells == (("0.0", ""), ("1.0", "2.5"))
    assert block.columns == (("time", "s"), ("stress", "kPa"))
    for wrong in ({}, {"time": ("s", [0.0, 1.0]), "stress": ("Pa", [1.0])}):
        with pytest.raises(InputError, match="must have one length"):
            Block.of(wrong)
