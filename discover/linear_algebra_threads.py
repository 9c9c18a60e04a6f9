"""One thread for each product of matrices, where the user has not chosen a number."""

import os

_CHOSEN = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS")


def use_one_thread() -> None:
    """Let NumPy's and SciPy's linear algebra run in the thread that calls it.

    OpenBLAS lets a thread for each core spin while it waits for the next product. The matrices here
    have some hundred rows, and what runs side by side are trials, in threads of their own: a
    product then takes up to thirty times the processor, and the search around it waits for it. It
    is a setting of the whole process, as double precision is. A number of threads that one of the
    environment's variables names is left as it is.
    """
    if any(os.environ.get(name) for name in _CHOSEN):
        return
    from threadpoolctl import threadpool_limits

    # for a library that is loaded later, and for processes begun from here
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    threadpool_limits(1, "blas")
