"""A saved estimator, whichever learner it is of."""

import os
from pathlib import Path

from discover.errors import InputError
from discover.learners.files import EstimatorFile
from discover.learners.tbnn_ude import TBNNUDE
from discover.learners.tensor_sindy import TensorSINDy

_LEARNERS = {one.learner: one for one in (TensorSINDy, TBNNUDE)}


def load(path: str | Path) -> TensorSINDy | TBNNUDE:
    """Return the fitted estimator in a file that its `save` wrote; it predicts the same numbers.

    Raises
    ------
    InputError
        If there is no such file, it is something else or damaged, or it needs a law that is not
        registered here.

    Examples
    --------
    >>> import discover as dc
    >>> law = dc.load("law.discover")  # doctest: +SKIP
    >>> law.predict(test)  # doctest: +SKIP
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"load takes the path of a file; got a {type(path).__name__}.")
    file = EstimatorFile(path)
    if file.learner not in _LEARNERS:
        raise InputError(
            f"{path} holds an estimator of the kind {file.learner!r}; known are "
            f"{', '.join(_LEARNERS)}. Give a file that one of them saved."
        )
    return _LEARNERS[file.learner]._from_file(file)
