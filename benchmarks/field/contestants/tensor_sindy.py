"""The sparse learner of this package, with the library that a study has by default."""

from field import Answer, Training
from field.with_discover import in_words, predictor, runs

TITLE = "sparse regression (this package)"


def learn(training: Training) -> Answer:
    """Return the sparse law that sparse regression finds."""
    import discover as dc

    model = dc.TensorSINDy(
        library=dc.build_library(degree=1, closed_forms=("exp",)),
        modulus=training.modulus,
        relaxation_time=training.relaxation_time,
        random_state=training.seed,
    ).fit(runs(training))
    return Answer(predictor(model.fluid_), *in_words(model.terms_))
