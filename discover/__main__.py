"""``python -m discover``: the command ``discover`` of this very Python."""

from discover.cli import main

if __name__ == "__main__":
    main()
