"""A benchmark of the field: the same σ12 records, blind laws, ours and what else one could use.

A file in `contestants` is a contestant; `docs/evidence.md` says what it has to hold.
"""

from field.contract import LAW_NAMES, Answer, Flow, Record, Training

__all__ = ["LAW_NAMES", "Answer", "Flow", "Record", "Training"]
