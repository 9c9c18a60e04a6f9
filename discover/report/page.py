"""Templates → one self-contained page. The only place that knows jinja2."""

import os
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from discover._version import __version__
from discover.report.palette import style_sheet
from discover.report.wording import percent, percent_range
from discover.words import estimate, interval, readable, significant

_CALCULATES = ("numpy", "scipy", "jax", "diffrax", "optimistix", "optax", "pysindy")


def made_by(fingerprint: str, command: str, files: tuple[str, ...], study_text: str) -> dict:
    """Return what a page says of the run that made it; every table links to it.

    `fingerprint`: of the study, its data and the version of this software. `command`: what makes it
    again. `files`: written beside the page.
    """
    packages = [f"Python {platform.python_version()}"]
    for name in _CALCULATES:
        try:
            packages.append(f"{name} {version(name)}")
        except PackageNotFoundError:  # a copy that was not installed
            continue
    return {
        "id": fingerprint[:8],
        "fingerprint": fingerprint,
        "command": command,
        "packages": ", ".join(packages),
        "files": files,
        "study_text": study_text,
    }


def _as_link(name: str) -> str:
    """Return a file's name as it stands in a link, be it UTF-8 or not."""
    return quote(os.fsencode(name))


_MOST_INSIDE = 3_000_000
"""Characters of a file that a page carries; more would make the page slow to open."""


def render(template: str, data: Mapping[str, str] | None = None, **content: Any) -> str:
    """Return a page.

    Everything is escaped except pictures and mathematics that this package wrote itself.

    `template`: file in ``templates``. `data`: text of files that each picture links to, by name.
    The page carries those that are not too long, so that it hands them out where it stands alone;
    the others lie beside it. `content`: its variables.
    """
    carried = {name: text for name, text in (data or {}).items() if len(text) <= _MOST_INSIDE}
    return (
        _environment()
        .get_template(template)
        .render(
            version=__version__,
            style_sheet=Markup(style_sheet()),
            data=data or {},
            carried=carried,
            **content,
        )
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("discover.report"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        percent=percent,
        percent_range=percent_range,
        significant=significant,
        interval=interval,
        estimate=estimate,
        readable=readable,
        safe_svg=Markup,
        as_link=_as_link,
    )
    return environment


def safe_name(name: str) -> str:
    """Return a file name without anything that a file system could take amiss."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in name)[:100]
