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
# # Closing the loop
#
# A fluid is declared to be upper convected Maxwell. It is not: the data come from a Giesekus fluid.
# The loop looks at the residual, scores what the model may lack, in the fluid and in the
# instrument, adds the best, and judges it on runs that no fit saw.

# %%
import matplotlib.pyplot as plt

from discover.precision import enable_x64

enable_x64()

from discover.closed_loop import DeclaredModel, run_loop
from discover.simulate import synthetic_dataset

data = synthetic_dataset("giesekus", {"alpha": 0.3}, noise=0.01, n_samples=51)
result = run_loop(
    data,
    DeclaredModel.maxwell(1.0, 1.0),
    held_out=["laos_2_1", "laos_2_0.5"],
    effects=["giesekus_mobility", "non_affine_motion", "stress_gain", "stress_offset"],
    max_effects=1,
)
print(result.verdict)
print(f"before: {result.error_before}")
print(f"after:  {result.error_after}, noise {result.noise_floor:.2%}")

# %% [markdown]
# ## What was added, and what it cannot be told from

# %%
for stage in result.stages:
    for name, parameter in stage.parameters.items():
        print(stage.effect, name, f"{parameter.value:.4f}", parameter.ci95)
    print("aliases:", stage.aliases)
    print("to confirm:", stage.check)

# %% [markdown]
# ## A held-out run, before and after

# %%
record = next(record for record in result.records if record.held_out)
figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
axis.plot(record.time, record.measured, ".", color="0.3", label="measured")
axis.plot(record.time, record.predicted[0], "-.", label="declared model")
axis.plot(record.time, record.predicted[-1], label="augmented model")
axis.set(xlabel="time", ylabel="σ12", title=record.name)
axis.legend()
plt.show()
