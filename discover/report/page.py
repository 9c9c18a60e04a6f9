"""Templates → one self-contained page. The only place that knows jinja2."""

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from discover import __version__
from discover.report.wording import interval, percent, significant, spoken


def render(template: str, **content: Any) -> str:
    """Return a page.

    Everything is escaped except pictures and mathematics that this package wrote itself.

    Parameters
    ----------
    template
        File in ``templates``.
    content
        Its variables.
    """
    environment = Environment(
        loader=PackageLoader("discover.report"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        percent=percent,
        significant=significant,
        interval=interval,
        spoken=spoken,
        safe_svg=Markup,
    )
    return environment.get_template(template).render(version=__version__, **content)
