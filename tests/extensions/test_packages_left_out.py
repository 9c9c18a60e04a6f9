"""A package that cannot be used is left out with one warning that names it."""

import pytest
from user_packages import install, project

from discover.laws.registry import _named_laws

BUILT_IN = len(_named_laws())
LOUD = 'import sys\nprint("imported", file=sys.stderr)\n'
LAW = """
import discover as dc
from discover.laws import Giesekus
dc.register_law({name!r}, Giesekus, {{"alpha": (0.0, 1.0)}})
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "entry", "why"),
    [
        ("import nowhere_to_be_found", {"mine": "mine"}, "ModuleNotFoundError: No module named"),
        ("1 / 0", {"mine": "mine"}, "ZeroDivisionError: division by zero"),
        ("def f(:", {"mine": "mine"}, "SyntaxError"),
        ("", {"mine": "elsewhere"}, "ModuleNotFoundError: No module named 'elsewhere'"),
        ("", {"mine": "mine:law"}, "AttributeError"),
        ("", {"mine": "mine"}, "mine registers no law of that name"),
        (LAW.format(name="giesekus"), {"giesekus": "mine"}, "the name is taken"),
        (LAW.format(name="giesekus"), {"mine": "mine"}, "'giesekus' is known already"),
        (LAW.format(name="Mine"), {"mine": "mine"}, "must be lower-case"),
        ("import sys; sys.exit(3)", {"mine": "mine"}, "SystemExit: 3"),
    ],
)
def test_a_broken_package_is_one_warning_and_all_else_works(workplace, code, entry, why):
    install(workplace.packages, "mine", code, project("laws", **entry))
    done = workplace.run("laws")
    assert "giesekus " in done.stdout
    assert len(done.stdout.splitlines()) == BUILT_IN
    (said,) = done.stderr.splitlines()
    assert said.startswith(f"discover: warning: The law {next(iter(entry))!r} of mine 2.5 is left")
    assert why in said


def test_a_sound_package_is_loaded_once_where_laws_are_asked_for_without_a_warning(workplace):
    # negative control of the tests above; two laws of one module are one import
    code = LOUD + LAW.format(name="one") + LAW.format(name="two")
    install(workplace.packages, "mine", code, project("laws", one="mine", two="mine"))
    done = workplace.run("laws")
    assert done.stderr == "imported\n"
    assert len(done.stdout.splitlines()) == BUILT_IN + 2
    # nor is it loaded where no law is asked for
    assert workplace.run("--help").stderr == ""
    assert workplace.run("effects").stderr == ""


def test_of_two_packages_with_one_name_the_second_is_left_out_and_one_imported_before_is_known_once(
    workplace,
):
    for name in ("one", "two"):
        install(workplace.packages, name, LAW.format(name="ours"), project("laws", name, ours=name))
    install(workplace.packages, "mine", LAW.format(name="mine"), project("laws", mine="mine"))
    script = "import mine, discover as dc; print(*dc.laws().loc[['mine', 'ours'], 'parameter'])"
    done = workplace.run(script=script)
    assert done.stdout == "alpha alpha\n"
    assert done.stderr.count("Warning: ") == 1
    assert "'ours' is known already" in done.stderr
