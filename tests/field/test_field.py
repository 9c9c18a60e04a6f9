"""The benchmark of the field: its judge, its data, and what it keeps."""

import json

import numpy as np
import pytest
import run
from field import Answer, judged, truth, worst_errors
from independent import JohnsonSegalman, UpperConvectedMaxwell


def test_a_law_is_judged_by_what_it_predicts_unseen_and_running_away_is_the_largest_error():
    def contestant(factor):
        def predict(flow):
            return {name: factor * stress for name, stress in truth("Giesekus", flow).items()}

        return judged(lambda records, seed: Answer(predict, "giesekus"), "Giesekus", seed=3)

    assert set(contestant(1.0)["errors"].values()) == {0.0}
    errors = contestant(3.0)["errors"]
    assert 0.0 < errors.pop("N2") < 1.0  # over N1, which is larger
    assert list(errors.values()) == pytest.approx([2.0] * 3)
    assert contestant(1.0)["law"] == "giesekus"

    def run_away(flow):
        raise ArithmeticError(flow.name)

    assert set(worst_errors(Answer(lambda _: {}), "Giesekus").values()) == {None}
    assert set(worst_errors(Answer(run_away), "Giesekus").values()) == {np.inf}


@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_extension_from_rest_is_the_closed_form(slip):
    times, rate, carried = np.linspace(0.0, 3.0, 16), 0.4, (1.0 - slip) * 0.4

    def component(growth, drive):  # s' = drive + (growth − 1) s, s(0) = 0
        return drive * np.expm1((growth - 1.0) * times) / (growth - 1.0)

    closed = component(2.0 * carried, 2.0 * rate) - component(-carried, -rate)
    law = JohnsonSegalman(slip) if slip else UpperConvectedMaxwell()
    np.testing.assert_allclose(law.pull(rate, times), closed, atol=1e-7)  # integrated to 1e-9


def test_a_case_that_is_kept_is_not_run_again_and_is_in_the_table(tmp_path, capsys):
    errors = dict.fromkeys(("sigma12", "N1", "N2", "tensile"), 0.125)
    row = {"case": "tensor_sindy Giesekus", "question": "learn", "seed": 1, "law": "giesekus"}
    file = tmp_path / "field.jsonl"
    file.write_text(json.dumps(row | {"words": "kept", "errors": errors, "learning": 7.0}) + "\n")
    before = file.read_bytes()
    run.main(["field", "--cases", "tensor_sindy Giesekus", "--out", str(file)])
    assert file.read_bytes() == before
    said = capsys.readouterr().out
    assert (
        "(1 of 8 fluids) | 12 % (12 %) | 12 % (12 %) | 12 % (12 %) | 12 % (12 %) | 1 | 0 |" in said
    )
    assert "network in the equation (this package) | not run" in said
