"""The same network by the published recipe: Adam, one record added at a time, and a penalty.

[Rodrigues, Thompson, Oliveira & Ausas, arXiv:2501.00556], in the implementation of this package.
"""

from field import Answer, Training
from field.with_discover import predictor, runs

TITLE = "the same network, plain Adam recipe"


def learn(training: Training) -> Answer:
    """Return the law of one network after 900 iterations for each record."""
    import discover as dc

    model = dc.TBNNUDE(
        recipe="paper",
        n_members=1,
        modulus=training.modulus,
        relaxation_time=training.relaxation_time,
        random_state=training.seed,
    ).fit(runs(training))
    return Answer(predictor(model.fluid_), words="a network")
