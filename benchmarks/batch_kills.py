"""Kill a batch at random, let it go on, and compare its results with those of an undisturbed one.

    python benchmarks/batch_kills.py [kills] [workers]

Prints the moments of the kills and, for every result file, whether it is byte for byte the same.
Wall-clock seconds, which no two runs share, are set to zero before the comparison; nothing else is.
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
    studies = [str(folder / name) for name in ("loop.toml", "comparison.toml", "broken.toml")]
    code = "from discover.cli import main; main()"
    options = ["--out", str(out), "--workers", str(workers), "--quiet"]
    return [sys.executable, "-c", code, "batch", *studies, *options]


def results(out: Path) -> dict[str, bytes]:
    """Return every file that does not say when it was made, without wall-clock seconds."""
    kept = {}
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        pages = path.suffix == ".html" or name == "batch.json" or "/state/" in f"/{name}"
        if path.is_file() and not pages:
            kept[name] = SECONDS.sub(rb"\g<1>0", path.read_bytes())
    return kept


def main(kills: int = 10, workers: int = 1) -> int:
    generator = random.Random(0)
    folder = Path(tempfile.mkdtemp())
    for name, text in (("loop", LOOP), ("comparison", COMPARISON), ("broken", BROKEN)):
        (folder / f"{name}.toml").write_text(text)
    started = time.perf_counter()
    subprocess.run(command(folder, folder / "calm", workers), capture_output=True)
    whole = time.perf_counter() - started
    print(f"undisturbed: {whole:.0f} s")
    killed = 0
    for _ in range(kills):
        process = subprocess.Popen(
            command(folder, folder / "killed", workers),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        delay = generator.uniform(0.02, 0.8) * whole
        try:
            process.wait(delay)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            killed += 1
            print(f"killed after {delay:.0f} s")
        else:
            print("had ended before the kill")
    done = subprocess.run(command(folder, folder / "killed", workers), capture_output=True)
    calm, disturbed = results(folder / "calm"), results(folder / "killed")
    same = [name for name in calm if disturbed.get(name) == calm[name]]
    for name in calm:
        print(f"{'same' if name in same else 'DIFFERENT':<10}{name}")
    extra = sorted(set(disturbed) - set(calm))
    print(f"{killed} kills, {len(same)} of {len(calm)} files identical, {len(extra)} left over")
    print(f"exit code {done.returncode} (2: one study is broken on purpose)")
    if len(same) == len(calm) and not extra:
        shutil.rmtree(folder)
        return 0
    print(f"kept for a look: {folder}")
    return 1


if __name__ == "__main__":
    sys.exit(main(*(int(argument) for argument in sys.argv[1:3])))
