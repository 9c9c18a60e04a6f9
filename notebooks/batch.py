# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Many studies
#
# How much noise can a closed loop stand? One study for each level of noise answers that. One study
# is broken on purpose and cannot run. From a terminal, the same is `discover batch studies/*.toml
# --out results`.

# %%
import json
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import discover as dc
from discover.batch.run import run_batch

STUDY = """
[data]
synthetic = {{ law = "giesekus", parameters = {{ alpha = {alpha} }}, noise = {noise}, samples = 51 }}
held_out = ["laos_2_1", "laos_2_0.5"]
[loop]
max_effects = 1
effects = ["giesekus_mobility", "non_affine_motion", "stress_gain", "stress_offset"]
"""

folder = Path(tempfile.mkdtemp())
studies = []
for noise in (0.01, 0.1, 0.5):
    path = folder / f"noise_{100 * noise:02.0f}.toml"
    path.write_text(STUDY.format(alpha=0.3, noise=noise))
    studies.append(path)
# a mobility beyond one is no Giesekus fluid
broken = folder / "mobility.toml"
broken.write_text(STUDY.format(alpha=2.0, noise=0.01))
studies = [studies[0], broken, *studies[1:]]

# %% [markdown]
# ## It is stopped half-way
#
# Somebody presses Ctrl-C, the power fails, or the cluster's time is up. Here the progress function,
# which is told what is going on and what fraction is done, stops the batch once two studies have
# ended.


# %%
def stop_after_two(label, fraction):
    if label.startswith("2 of 4 ended"):
        raise KeyboardInterrupt


out = folder / "results"
try:
    run_batch(studies, out, progress=stop_after_two)
except KeyboardInterrupt:
    print("stopped")
pd.read_csv(out / "table.csv")[["study", "outcome", "text"]]

# %% [markdown]
# The page and the table are kept up to date while studies run. The failed study says what to fix,
# and the rest went on without it.
#
# ## It resumes
#
# Make the same call again. Finished studies are not touched (`complete`), the rest are run now, and
# the results are the same, byte for byte, as those of an undisturbed batch.

# %%
before = (out / "noise_01" / "loop.json").stat().st_mtime_ns
result = run_batch(studies, out)
assert (out / "noise_01" / "loop.json").stat().st_mtime_ns == before
for study in result.studies:
    print(f"{study.status:<9}{study.name}: {study.text}")

# %% [markdown]
# ## The table
#
# One line for each study. `result.index` is a page that sorts by any column; `table.csv` can be read
# without this software.

# %%
result

# %%
table = pd.read_csv(out / "table.csv")
table.loc[table["outcome"] == "failed", ["study", "text"]]

# %% [markdown]
# From here on it is JSON and pandas. With more noise, the remaining error on the held-out runs is the noise
# itself. What the loop adds to the declared Maxwell fluid is visible as long as the error before it
# is above the error after it.

# %%
found = {path.parent.name: json.loads(path.read_text()) for path in out.glob("*/loop.json")}
done = pd.DataFrame(
    {
        name: {
            "effects": ", ".join(stage["effect"] for stage in loop["stages"]),
            "verdict": loop["verdict"],
            "error_before": loop["error_before"]["held_out"],
            "error_after": loop["error_after"]["held_out"],
        }
        for name, loop in sorted(found.items())
    }
).T
done

# %%
axis = done[["error_before", "error_after"]].plot.bar(figsize=(6, 3), rot=0)
axis.set(xlabel="", ylabel="error on held-out runs")
plt.show()

# %% [markdown]
# ## One study again
#
# Every study has a folder of its own, with a report, and the law with the flows in which it was
# tested. It can be read back and simulated.

# %%
law = dc.equations.read_result_laws(out / "noise_10")["augmented"]
law

# %%
law.sympy()

# %% [markdown]
# `run_batch(studies, out, workers=2)` runs two studies at a time, `scheduler="tcp://host:8786"` all
# that a cluster has room for; `docs/batches.md` says how to set one up under SLURM. Nothing is lost
# if a worker dies.
