"""Results that can be written as a page."""

from importlib import import_module
from pathlib import Path
from typing import ClassVar


class PageView:
    """A result with a page in the report; a class says with `_page` who writes it."""

    _page: ClassVar[str]
    """Module and function, with a colon between: from the result to the text of the page."""

    def to_html(self, path: str | Path) -> Path:
        """Write the report on this result as one self-contained file.

        Parameters
        ----------
        path
            The file, such as ``comparison.html``; replaced if it is there.

        Returns
        -------
        The file.
        """
        # the report stands above the results that it shows, and brings matplotlib with it: it is
        # named here, and loaded only when somebody wants a page
        module, _, function = self._page.partition(":")
        text = getattr(import_module(module), function)(self)
        path = Path(path)
        path.write_text(text, encoding="utf-8")
        return path
