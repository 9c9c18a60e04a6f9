"""What a search leaves out of its grid is said."""

import numpy as np
from independent.folders import write_table

import discover as dc
from discover.learners.settings import known_part
from discover.learners.tbnn_ude import estimator as of_network


def test_the_network_sees_every_state_of_a_sweep_in_fewer_steps(tmp_path):
    strains = np.geomspace(0.1, 10.0, 24)
    columns = {"strain": strains, "omega_rad_s": np.ones(24), "Gp_Pa": strains, "Gpp_Pa": strains}
    write_table(tmp_path / "amplitude_sweep.csv", columns)
    runs = list(dc.load_dataset(tmp_path).with_material_functions())
    known = known_part(dc.Fluid(dc.make_law("ucm"), [300.0, 200.0], [2.0, 0.1]))
    fine = of_network.make_problem(runs, known)
    rough, said = of_network._rougher(fine, runs, known, 100)
    assert np.array_equal(rough.records.recorded, fine.records.recorded)
    assert rough.flows.n_steps <= fine.flows.n_steps / 1.5
    assert "fewer steps than it is tested in" in said
    assert "samples" not in said
