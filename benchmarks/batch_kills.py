"""Kill a batch at random, let it go on, and compare its results with those of an undisturbed one.

    python benchmarks/batch_kills.py [kills] [workers]

Without a worker (0) it is `compare`, of one study, that is killed. A batch that gets through is
compared, and the next starts afresh, until there were so many kills. Prints their moments, and
every result file that is not byte for byte the same. Wall-clock seconds, which no two runs share,
are set to zero before the comparison; nothing else is.
"""

import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

LOOP = """
[data]
synthetic = { law = "giesekus", parameters = { alpha = 0.2 }, noise = 0.01, samples = 21 }
[loop]
max_effects = 1
effects = ["giesekus_mobility", "stress_offset"]
"""
COMPARISON = """
[data]
synthetic = { law = "ptt_linear", parameters = { epsilon = 0.2 }, noise = 0.01, samples = 11 }
[compare]
learners = ["tensor_sindy"]
max_terms = 1
high_deborah = []
next = { flows = ["start_up"], observe = ["N1"] }
"""
BROKEN = "[data]\n"
SECONDS = re.compile(rb'("(?:train_)?seconds": )[-+0-9.e]+')


def command(folder: Path, out: Path, workers: int) -> list[str]:
    python = [sys.executable, "-c", "from discover.cli import main; main()"]
    options = ["--out", str(out), "--quiet"]
    if not workers:
        return [*python, "compare", str(folder / "comparison.toml"), *options]
    studies = [str(folder / name) for name in ("loop.toml", "comparison.toml", "broken.toml")]
    return [*python, "batch", *studies, *options, "--workers", str(workers)]


def results(out: Path) -> dict[str, bytes]:
    """Return every file that does not say when it was made, without wall-clock seconds."""
    kept = {}
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        pages = path.suffix == ".html" or name == "batch.json" or "/state/" in f"/{name}"
        if path.is_file() and not pages:
            kept[name] = SECONDS.sub(rb"\g<1>0", path.read_bytes())
    return kept


def compare(calm: dict[str, bytes], out: Path) -> bool:
    """Print whether a batch that was disturbed ended with the files of the calm one."""
    disturbed = results(out)
    same = [name for name in calm if disturbed.get(name) == calm[name]]
    different = [name for name in calm if name not in same]
    extra = sorted(set(disturbed) - set(calm))
    print(f"  ended: {len(same)} of {len(calm)} files identical, {len(extra)} left over")
    for name in different + extra:
        print(f"  DIFFERENT: {name}")
    return not different and not extra


def main(kills: int = 10, workers: int = 1) -> int:
    generator = random.Random(0)
    folder = Path(tempfile.mkdtemp())
    for name, text in (("loop", LOOP), ("comparison", COMPARISON), ("broken", BROKEN)):
        (folder / f"{name}.toml").write_text(text)
    started = time.perf_counter()
    subprocess.run(command(folder, folder / "calm", workers), capture_output=True)
    whole = time.perf_counter() - started
    calm = results(folder / "calm")
    print(f"undisturbed: {whole:.0f} s, {len(calm)} files")
    killed, batches, good = 0, 0, True
    while killed < kills:
        # a batch that got through starts afresh, so that every kill meets one at work
        batches += 1
        out, first = folder / f"killed{batches}", killed
        while True:
            delay = generator.uniform(0.02, 0.8) * whole if killed < kills else None
            started = time.perf_counter()
            process = subprocess.Popen(
                command(folder, out, workers), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            try:
                process.wait(delay)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                killed += 1
                print(f"batch {batches}: killed after {delay:.0f} s", flush=True)
            else:
                break
        if killed == first:
            # compiled programs are kept, so that later runs are faster than the first
            whole = min(whole, time.perf_counter() - started)
        good = compare(calm, out) and good
        expected = 2 if workers else 0  # one study of the batch is broken on purpose
        print(f"  exit code {process.returncode} (expected: {expected})", flush=True)
        good = good and process.returncode == expected
    print(f"{killed} kills in {batches} batches: {'nothing' if good else 'SOMETHING'} changed")
    if good:
        shutil.rmtree(folder)
        return 0
    print(f"kept for a look: {folder}")
    return 1


if __name__ == "__main__":
    sys.exit(main(*(int(argument) for argument in sys.argv[1:3])))
