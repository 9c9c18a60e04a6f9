"""The network of this package, by its default recipe."""

from field import Answer, Training
from field.with_discover import predictor, runs

TITLE = "network in the equation (this package)"


def learn(training: Training) -> Answer:
    """Return the law of the network that is taken, of three."""
    import discover as dc

    model = dc.TBNNUDE(
        modulus=training.modulus,
        relaxation_time=training.relaxation_time,
        random_state=training.seed,
    ).fit(runs(training))
    return Answer(predictor(model.fluid_), words="a network")
