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
# # What shear stress determines, and what not
#
# Five questions about one fluid, in ten minutes. The data are σ12 of a Johnson–Segalman fluid in four
# oscillatory flows, with 2 % noise. Nothing else was measured.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import discover as dc
from tensor_library import LawTerm

flows = {f"laos_{wi:g}_{de:g}": dc.oscillatory_shear(wi, de) for wi in (1, 2) for de in (0.5, 1)}
data = dc.synthetic_dataset(
    "johnson_segalman", {"xi": 0.4}, protocol=flows, noise=0.02, n_samples=65, duration=8.0
)
extra = ("tr(sigma)*sigma", "tr(sigma)*gammadot", "tr(sigma.gammadot)*I")
library = dc.build_library(extra=extra)

# %% [markdown]
# ## 1. Before any fit: what could these flows determine?
#
# The sensitivities of σ12 to every coefficient of the library have null directions: combinations
# that no measurement in these flows can ever see, however small the noise.

# %%
dc.identify.analyse_structure(data, library)

# %% [markdown]
# Around a law with slip more of them are unseen, and change N1 and N2.

# %%
slip = [LawTerm("sigma.gammadot+gammadot.sigma", 0.2)]
dc.identify.analyse_structure(data, library, slip)

# %% [markdown]
# ## 2. The fit, with intervals
#
# The interval allows for residuals that are correlated in time; here they are not.

# %%
model = dc.TensorSINDy(library, max_terms=3).fit(data)
print(model.result_.details["noise"])
model.result_

# %% [markdown]
# ## 3. Indistinguishable laws
#
# Laws with the same σ12 in *every* shear history. The proof is exact arithmetic on the Taylor
# series of the stress in a general history; a simulation checks it.

# %%
twins = dc.identify.find_twins(library, model.terms_)
for twin in twins:
    print("-", twin.text)
pd.DataFrame([dict(twin.line()) for twin in twins])

# %% [markdown]
# ## 4. Rivals at this noise
#
# Other laws that were fitted and that their evidence does not rule out.

# %%
model.result_.rivals_table()

# %% [markdown]
# ## 5. What to measure next
#
# Both laws give the same σ12 in every flow, so no shear stress separates them. N2 does.

# %%
same_in_shear = dc.equations.Equation((LawTerm("tr(sigma)*gammadot", 0.32),))
fluids = {
    "slip": dc.Fluid(dc.make_law("johnson_segalman", {"xi": 0.4}), 1.0, 1.0),
    "twin": same_in_shear.fluid(),
}
flow, times = dc.oscillatory_shear(2.0, 1.0), np.linspace(0.0, 8.0, 161)
stresses = {name: dc.simulate(fluid, flow, times) for name, fluid in fluids.items()}
n2 = {name: stress.second_normal_stress_difference for name, stress in stresses.items()}
n1 = stresses["slip"].first_normal_stress_difference
print(f"N2 differs by {np.linalg.norm(n2['slip'] - n2['twin']) / np.linalg.norm(n1):.0%} of N1.")

# %%
figure, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
for name, style in (("slip", "-"), ("twin", "--")):
    axes[0].plot(times, stresses[name].shear_stress, style, label=name)
    axes[1].plot(times, n2[name], style, label=name)
for axis, quantity in zip(axes, ("sigma12", "N2"), strict=True):
    axis.set(xlabel="t / λ", ylabel=quantity)
axes[0].legend()
plt.show()

# %% [markdown]
# σ12 agrees for both laws. N2 distinguishes them at a glance, so that is what has to be measured.
