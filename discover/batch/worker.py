"""A process that runs one study after the other for `discover.batch.workers`.

Jobs come, and word of them goes, as lines of JSON: there is no port that others could reach.
"""

import json
import os
import signal
import sys
import threading
from dataclasses import asdict
from queue import SimpleQueue
from typing import Any

from discover.inputs_kept import inputs_kept
from discover.processor import use_one_thread_from_the_start
from discover.report.plots import keep_out_of_the_working_directory


def main() -> None:
    """Run what is asked for until standard input ends, and then end at once.

    It ends when the process that asks is gone, however that ended. A study is not waited for: it
    would keep its folder locked, and what it had finished is kept.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that asks hears Ctrl-C
    use_one_thread_from_the_start()
    keep_out_of_the_working_directory()
    from discover.batch.run import run_one
    from discover.batch.status import now_and_then

    # what a library prints must not stand between the lines
    lines = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)
    lock = threading.Lock()

    def send(**word: Any) -> None:
        with lock:
            lines.write(json.dumps(word) + "\n")
            lines.flush()

    jobs: SimpleQueue[list[Any]] = SimpleQueue()
    threading.Thread(target=_listen, args=(jobs,), daemon=True).start()
    while True:
        job = jobs.get()
        progress = now_and_then(lambda text, fraction: send(progress=[text, float(fraction)]))
        with inputs_kept():
            status = run_one(*job, progress=progress)
        send(status=asdict(status))


def _listen(jobs: "SimpleQueue[list[Any]]") -> None:
    for line in sys.stdin.buffer:
        jobs.put(json.loads(line))
    os._exit(0)


if __name__ == "__main__":
    main()
