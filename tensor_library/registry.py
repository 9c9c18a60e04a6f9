"""What is known by name: built in, registered by a program, or brought by an installed package.

A package of one's own brings a law, an effect, a closed form, an importer or a learner by an entry
point [PyPA, Entry points specification] that names the module which registers it. The modules are
imported when a name is first looked up, so that a program which needs none of them loads none.
"""

import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

T = TypeVar("T")


class ExtensionWarning(UserWarning):
    """An installed package announces something that cannot be used; it is left out."""


class Registry(MutableMapping[str, T]):
    """Things of one kind by name, in the order in which they became known.

    `kind`: what they are, in the singular, for messages. `group`: group of entry points that bring
    more of them, such as ``"discover.laws"``. `built_in`: makes those that are always there.
    """

    def __init__(self, kind: str, group: str, built_in: Callable[[], Mapping[str, T]]):
        self.kind, self.group = kind, group
        self._built_in = built_in
        self._known: dict[str, T] = {}
        self._own: frozenset[str] | None = None
        self._looked = self._complete = False
        self._lock = threading.RLock()

    @property
    def present(self) -> dict[str, T]:
        """What is built in and what was registered, without looking at installed packages."""
        with self._lock:
            if self._own is None:
                self._own = frozenset()  # should the making of them look here
                self._known.update(self._built_in())
                self._own = frozenset(self._known)
            return self._known

    @property
    def built_in(self) -> dict[str, T]:
        """Return what is always there."""
        present = self.present
        return {name: present[name] for name in present if name in (self._own or ())}

    def __getitem__(self, name: str) -> T:
        return self._all()[name]

    def __setitem__(self, name: str, value: T) -> None:
        self.present[name] = value

    def __delitem__(self, name: str) -> None:
        del self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def _all(self) -> dict[str, T]:
        if self._complete:
            return self._known
        with self._lock:
            known = self.present
            if not self._looked:
                self._looked = True  # modules that are imported here may look here too
                for entry in entry_points(group=self.group):
                    self._bring(entry)
                self._complete = True
            return known

    def _bring(self, entry: EntryPoint) -> None:
        """Import the module that an entry point names; it registers what it brings."""
        if entry.name in (self._own or ()):
            self._leave_out(entry, "the name is taken by one that is built in")
            return
        try:
            entry.load()
        except (Exception, SystemExit) as error:
            kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
            self._leave_out(entry, kind + (str(error).splitlines() or [""])[0])
            return
        if entry.name not in self._known:
            self._leave_out(entry, f"{entry.value} registers no {self.kind} of that name")

    def _leave_out(self, entry: EntryPoint, why: str) -> None:
        whose = "an installed package"
        if entry.dist is not None:
            whose = f"{entry.dist.name} {entry.dist.version}"
        warnings.warn(
            f"The {self.kind} {entry.name!r} of {whose} is left out: {why.rstrip('.')}. Mend or "
            "remove that package; all else works.",
            ExtensionWarning,
            stacklevel=2,
        )
