"""Studies as tasks: one folder each, resumable, alone or many at a time."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from discover.batch.run import run_batch as run_batch

__all__ = ["run_batch"]


def __getattr__(name: str) -> Any:
    # a worker imports this package before it says how many threads it uses
    if name != "run_batch":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from discover.batch.run import run_batch

    return run_batch
