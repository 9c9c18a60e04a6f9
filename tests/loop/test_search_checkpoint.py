"""A loop that was interrupted goes on where it was, and ends where an undisturbed one does."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from discover.loop import DeclaredModel, run_loop
from discover.dataset import Dataset, Run
from discover.laws import Fluid, Giesekus
from discover.protocols import start_up
from discover.simulate import simulate

TIMES = np.linspace(0.05, 10.0, 80)
EFFECTS = ("giesekus_mobility", "stress_offset", "stress_gain", "solvent_viscosity")


class Interrupted(BaseException):
    """Ctrl-C."""


class Store:
    """Keeps what a folder would, as text; breaks off after so many parts."""

    def __init__(self, breaks_after=None):
        self.parts, self.saved, self.breaks_after = {}, 0, breaks_after

    def load(self, part):
        return json.loads(self.parts[part]) if part in self.parts else None

    def save(self, part, content):
        self.parts[part] = json.dumps(content)
        self.saved += 1
        if self.saved == self.breaks_after:
            raise Interrupted


@pytest.fixture(scope="module")
def dataset():
    fluid = Fluid(Giesekus(jnp.asarray(0.3)), jnp.asarray(100.0), jnp.asarray(1.0))
    generator = np.random.default_rng(0)
    runs = []
    for rate in (0.5, 1.0, 2.0, 3.0):
        stress = simulate(fluid, start_up(rate), TIMES).shear_stress
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * generator.standard_normal(TIMES.size)
        rates = np.full(TIMES.size, rate)
        runs.append(Run(f"at_{rate:g}", TIMES, start_up(rate), rates, stress + noise + 6.0))
    return Dataset("with an offset", tuple(runs))


def loop(dataset, store=None, say=None):
    return run_loop(
        dataset, DeclaredModel.maxwell(100.0, 1.0), held_out=["at_3"], effects=EFFECTS,
        max_effects=2, store=store, progress=say,
    )  # fmt: skip


@pytest.mark.slow
def test_an_interrupted_loop_ends_where_an_undisturbed_one_does(dataset):
    store = Store()
    undisturbed = loop(dataset, store)
    assert {stage.effect for stage in undisturbed.stages} == {"giesekus_mobility", "stress_offset"}
    assert store.saved >= 2
    for breaks_after in range(1, store.saved + 1):
        broken = Store(breaks_after)
        with pytest.raises(Interrupted):
            loop(dataset, broken)
        said = []
        resumed = loop(dataset, broken, said.append)
        assert resumed.stages == undisturbed.stages
        assert resumed.error_after == undisturbed.error_after
        assert resumed.explanations == undisturbed.explanations
        assert [[c.effect for c in r] for r in resumed.rankings] == [
            [c.effect for c in r] for r in undisturbed.rankings
        ]
        assert said[0].startswith("going on from what was kept")


@pytest.mark.slow
def test_what_another_list_of_candidates_left_is_not_gone_on_from(dataset):
    store = Store()
    loop(dataset, store)
    said = []
    run_loop(
        dataset, DeclaredModel.maxwell(100.0, 1.0), held_out=["at_3"], max_effects=1,
        effects=["stress_gain"], store=store, progress=said.append,
    )  # fmt: skip
    assert said[0].startswith("declared model")
