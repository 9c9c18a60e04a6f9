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
# # Two learners on identical data
#
# Eight oscillatory runs on a Giesekus fluid, shear stress only, with 1 % noise. The learners know
# the upper-convected Maxwell part and look for what is missing. Then we ask each for the normal
# stresses, which nobody measured, in a flow that neither saw.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import discover as dc

data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01, n_samples=51)
data

# %% [markdown]
# ## Sparse regression
#
# The candidate terms are the eight tensors of the integrity basis with constant coefficients.

# %%
sparse = dc.TensorSINDy(max_terms=2).fit(data)
sparse

# %% [markdown]
# ## A neural network inside the differential equation
#
# The quick setting: fewer steps than the default.

# %%
network = dc.TBNNUDE(quick=True).fit(data)
network

# %% [markdown]
# Projected onto the library, its law is an expression like the other one.

# %%
network.equation_.sympy()

# %%
print(sparse.equation_.latex())

# %% [markdown]
# ## Start-up, which neither saw
#
# N2 is the choice of the simplest law that fits: shear stress alone does not determine it.

# %%
times = np.linspace(0.0, 10.0, 101)
fluids = {"truth": data.truth, "sparse": sparse.fluid_, "network": network.fluid_}
stresses = {name: dc.simulate(fluid, dc.start_up(2.0), times) for name, fluid in fluids.items()}
figure, axes = plt.subplots(1, 3, figsize=(10, 3), layout="constrained")
for (name, s), line in zip(stresses.items(), ("-", "--", ":"), strict=True):
    axes[0].plot(times, s.shear_stress, line, label=name)
    axes[1].plot(times, s.first_normal_stress_difference, line)
    axes[2].plot(times, s.second_normal_stress_difference, line)
for axis, label in zip(axes, ("σ12 / G", "N1 / G", "N2 / G"), strict=True):
    axis.set(xlabel="t / λ", ylabel=label)
figure.legend(loc="outside upper center", ncols=3)
plt.show()

# %%
quantities = ("shear_stress", "first_normal_stress_difference", "second_normal_stress_difference")


def relative_error(name, quantity):
    true = getattr(stresses["truth"], quantity)
    return np.linalg.norm(getattr(stresses[name], quantity) - true) / np.linalg.norm(true)


pd.DataFrame({n: {q: relative_error(n, q) for q in quantities} for n in ("sparse", "network")})

# %% [markdown]
# `dc.compare([sparse, network], test)` does all this and says what is not determined and what to
# measure next; `discover compare study.toml` writes it as a page.
