"""The flows of Rodrigues et al., on which the two learners are compared."""

from discover.protocols.protocol import FlowProtocol, oscillatory_shear, start_up

TRAINING_DURATION = 20.0
"""Length of every training series, in relaxation times."""

TEST_DURATION = 40.0
"""Length of the oscillatory tests: past what training saw."""

DEBORAH_NUMBERS = (0.25, 0.5, 0.75, 1.0)
WEISSENBERG_NUMBERS = (1.0, 2.0)


def paper_training_protocols() -> dict[str, FlowProtocol]:
    """Return the eight training flows γ̇ = Wi cos(De t), keyed ``laos_WI_DE``."""
    return {
        f"laos_{wi:g}_{de:g}": oscillatory_shear(wi, de)
        for wi in WEISSENBERG_NUMBERS
        for de in DEBORAH_NUMBERS
    }


def paper_test_protocols() -> dict[str, FlowProtocol]:
    """Return the three flows that no training saw, keyed by name.

    ``laos_2_1`` repeats a training flow past its last time, as the paper does.
    """
    return {
        "laos_3_1.5": oscillatory_shear(3.0, 1.5),
        "laos_2_1": oscillatory_shear(2.0, 1.0),
        "startup_2": start_up(2.0),
    }
