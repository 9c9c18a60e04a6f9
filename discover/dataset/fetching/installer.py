"""Packages by way of the installer that the user already has, with its index and settings."""

import subprocess
from pathlib import Path

from discover.python_child import python_command

_LONGEST = 600.0  # seconds


def download_with_pip(package: str, version: str, folder: Path) -> Path:
    """Download a package as a wheel, without installing it, and return the file.

    Nothing of the package is executed: a wheel is an archive.

    `package`, `version` in the package index that pip is set up for. `folder`: where to; an empty
    one. Raises OSError if pip is not there or cannot get the package; says what pip said last.
    """
    command = python_command("-m", "pip", "download", "--quiet", "--no-deps")
    command += ["--disable-pip-version-check", "--only-binary", ":all:"]
    command += ["--dest", str(folder), f"{package}=={version}"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST)
    except subprocess.TimeoutExpired:
        raise OSError(f"pip did not get {package} {version} in {_LONGEST:.0f} s.") from None
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode != 0 or not wheels:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1][:300]
        raise OSError(
            f"pip could not get {package} {version}: {last}. Check the network and pip's index, or "
            f"download the wheel yourself and give it with --from."
        )
    return wheels[0]
