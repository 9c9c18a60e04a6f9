"""Compiled programs kept between runs of the software."""

import os
import re
import stat
import warnings
import zlib
from collections import Counter
from contextlib import suppress
from functools import cache
from pathlib import Path

# Diffrax and Optimistix report errors inside a program through a call back to Python, and a program
# with such a call cannot be kept. So, where nothing else was asked for, an error becomes NaN: every
# solve of this library reads the solver's result and refuses what is not finite. Equinox reads this
# when it is first imported, which is why it stands here and not in the function.
os.environ.setdefault("EQX_ON_ERROR", "nan")

# What XLA starts piece by piece, in threads that wait for one another, at every step of a loop. The
# loops here are thousands of steps on arrays of a few hundred numbers: as one piece of machine code
# each they take half the processor, and fits side by side do not disturb one another. XLA reads
# this when it compiles first, and has no such option for one program.
_WHOLE_LOOPS = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=100000000"
if "xla_backend_extra_options" not in (_flags := os.environ.get("XLA_FLAGS", "")):
    os.environ["XLA_FLAGS"] = f"{_flags} {_WHOLE_LOOPS}".strip()

_ENTRY = re.compile(r".*-[0-9a-f]{64}-cache")
"""Names that JAX gives: that of the function, and a digest."""


_found: Counter[bool] = Counter()


def count_program(kept: bool) -> None:
    """Count a program that an earlier start kept, or that has to be compiled."""
    _found[kept] += 1


def compiled_share() -> float:
    """Return the share of programs of this process that were compiled, and not kept before."""
    return _found[False] / max(_found.total(), 1)


def enable_compilation_cache(folder: str | Path | None = None) -> Path | None:
    """Let JAX keep what it compiled, in a folder that only this user can write.

    Called when something that computes is first used (`discover.first_use`). `folder`: by default
    what JAX was told to use, or ``discover/compiled`` in the user's cache folder;
    ``DISCOVER_NO_CACHE`` keeps nothing. Returns the folder, or None where nothing is kept.
    """
    import jax

    if os.environ.get("DISCOVER_NO_CACHE"):
        return None
    chosen = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    given = folder is None and bool(chosen)  # by the user, or by an earlier call
    if "://" in str(chosen):
        return None  # a place that is no folder of this machine: JAX's business
    default = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "discover" / "compiled"
    try:
        folder = Path(folder or chosen or default).expanduser()
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    except (OSError, RuntimeError):
        return None  # a home that cannot be found or written to costs time, not the run
    if not is_ours_alone(folder):
        if given:
            jax.config.update("jax_enable_compilation_cache", False)
        return None
    if given:
        return folder
    with suppress(OSError):
        remove_cut_short(folder)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    # one that another process is about to write is compiled anew, which nobody needs to know
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
    # small ones too: some thirty of a comparison together take a second of each start
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    return folder


@cache
def is_ours_alone(folder: Path) -> bool:
    """Return whether only this user can write to a folder; warns once where others can.

    A cache holds machine code: whoever can write there acts as this user.
    """
    if not hasattr(os, "geteuid"):  # Windows, where a user's folders are the user's own
        return True
    found = os.stat(folder)
    if found.st_uid != os.geteuid():
        reason, remedy = "belongs to another user", "Name one of your own"
    elif found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        reason = "can be written to by other users"
        remedy = "Remove it, or run chmod go-w on it if you trust what it holds, or name another"
    else:
        return True
    warnings.warn(
        f"Compiled programs are not kept: the folder {folder} {reason}. {remedy} with "
        "JAX_COMPILATION_CACHE_DIR.",
        stacklevel=2,
    )
    return False


def remove_cut_short(folder: Path) -> None:
    """Remove programs that a full disk or a kill left incomplete, of which JAX would warn for ever.

    Each file is looked at once, at the first start after it was written.
    """
    stamp = folder / "checked"
    since = stamp.stat().st_mtime - 1.0 if stamp.is_file() else 0.0
    entries = (entry for entry in folder.glob("*-cache") if _ENTRY.fullmatch(entry.name))
    new = [entry for entry in entries if entry.stat().st_mtime > since]
    stamp.touch()
    for entry in new:
        if not _is_whole(entry.read_bytes()):
            entry.unlink(missing_ok=True)


def _is_whole(data: bytes) -> bool:
    if data.startswith(b"\x28\xb5\x2f\xfd"):  # zstd, where that is installed: left to JAX
        return True
    stream = zlib.decompressobj()
    try:
        stream.decompress(data)
    except zlib.error:
        return False
    return stream.eof
