"""What a discovery costs in programs compiled, which is the same on every machine."""

import jax
import pytest
from shared_flows import LIBRARY, small_dataset

from discover.learners.tensor_sindy import TensorSINDy

# of no other test: what they compiled would not be counted here
OWN_LIBRARY = LIBRARY.subset([*range(2, len(LIBRARY)), 0])


@pytest.fixture
def compiled(monkeypatch):
    """Count the programs that are built from here on."""
    names = []
    # after a thousand other tests the process may be full, and would drop programs between the
    # two fits (tests/programs looks at that)
    monkeypatch.setattr("discover.programs.program_cache.is_crowded", lambda: False)

    def listen(event, duration, **kwargs):
        del duration, kwargs
        if event == "/jax/core/compile/backend_compile_duration":
            names.append(event)

    jax.monitoring.register_event_duration_secs_listener(listen)
    yield names
    jax.monitoring.unregister_event_duration_listener(listen)


def data(law, parameters, seed):
    return small_dataset(law, parameters, noise=0.02, seed=seed)


@pytest.mark.slow
def test_no_support_and_no_data_set_needs_a_program_of_its_own(compiled):
    first_data = data("giesekus", {"alpha": 0.2}, 1)
    second_data = data("ptt_linear", {"epsilon": 0.4}, 2)
    compiled.clear()
    first = TensorSINDy(OWN_LIBRARY, n_stability=0, n_folds=0).fit(first_data)
    # in all: two large programs, and what NumPy would do without compiling; a support each would
    # be many more
    assert 2 <= len(compiled) < len(first.search_.fits)
    compiled.clear()
    second = TensorSINDy(OWN_LIBRARY, n_stability=0, n_folds=0).fit(second_data)
    assert set(second.search_.fits) != set(first.search_.fits)
    assert compiled == []
