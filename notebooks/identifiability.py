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
# # What shear stress can and cannot tell
#
# Five questions about one fluid, in ten minutes. The data are σ12 of a Johnson–Segalman fluid in four
# oscillatory flows, with 2 % noise. Nothing else was measured.

# %%
import matplotlib.pyplot as plt
import numpy as np

from discover.compilation_cache import enable_compilation_cache
from discover.first_use import enable_x64

enable_x64()
enable_compilation_cache()

from discover.identify import analyse_structure, find_twins
from discover.laws import Fluid, make_law
from discover.laws.expansion import law_of_terms
from discover.learners.tensor_sindy import TensorSINDy
from discover.protocols import oscillatory_shear
from discover.simulate import simulate, synthetic_dataset
from discover.summary_view import table_of
from tensor_library import LawTerms, TermLibrary, build_library, parse_term

flows = {f"laos_{wi:g}_{de:g}": oscillatory_shear(wi, de) for wi in (1, 2) for de in (0.5, 1)}
data = synthetic_dataset(
    "johnson_segalman", {"xi": 0.4}, protocol=flows, noise=0.02, n_samples=65, duration=8.0
)
extra = ("tr(sigma)*sigma", "tr(sigma)*gammadot", "tr(sigma.gammadot)*I")
library = TermLibrary((*build_library().terms, *map(parse_term, extra)))

# %% [markdown]
# ## 1. Before any fit: what could these flows tell?
#
# The sensitivities of σ12 to every coefficient of the library have null directions: combinations
# that no measurement in these flows can ever see, however small the noise.

# %%
structure = analyse_structure(list(data), library)
structure

# %%
for law in structure.laws:
    print("\n" + law.name)
    print(law.text)

# %% [markdown]
# ## 2. The fit, with intervals
#
# The interval allows for residuals that are correlated in time; here they are not.

# %%
model = TensorSINDy(library, max_terms=3).fit(data)
print(model.result_.details["noise"])
model.result_

# %% [markdown]
# ## 3. Twins
#
# Laws with the same σ12 in *every* shear history. The proof is exact arithmetic on the Taylor
# series of the stress in a general history; a simulation checks it.

# %%
found = LawTerms.of(model.terms_)
twins = find_twins(library, found)
for twin in twins:
    print("-", twin.text)
table_of(twins)

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
laws = {
    "slip": make_law("johnson_segalman", {"xi": 0.4}),
    "twin": law_of_terms(LawTerms({"tr(sigma)*gammadot": 0.32}), True),
}
flow, times = oscillatory_shear(2.0, 1.0), np.linspace(0.0, 8.0, 161)
stresses = {name: simulate(Fluid.dimensionless(law), flow, times) for name, law in laws.items()}
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
# σ12 agrees for both laws. N2 tells them apart at a glance, so that is what has to be measured.
