"""Studies: what a user asks for, checked, and what it means."""

from discover.study.data import fingerprint, parse_study, read_study
from discover.study.run_folder import RunFolder

__all__ = ["RunFolder", "fingerprint", "parse_study", "read_study"]
