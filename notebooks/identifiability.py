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
from discover.precision import enable_x64

enable_x64()
enable_compilation_cache()

from discover.identify import analyse_structure, find_rivals, find_twins
from discover.laws import Fluid, UpperConvectedMaxwell, make_law
from discover.learners.tensor_sindy import TensorSINDy
from discover.notebook_view import table_of
from discover.protocols import oscillatory_shear
from discover.simulate import simulate, synthetic_dataset
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
# Other laws that were tried and that a test on the residuals could not rule out.

# %%
find_rivals(model.search_, model.path_[model.result_.details["chosen"]])

# %% [markdown]
# ## 5. What to measure next
#
# The proposed experiment is the one expected to separate the remaining laws at this noise. Then we
# run it.

# %%
from discover.identify.design.experiment_outcome import judge_laws
from discover.identify.design.experiments import candidate_experiments
from discover.identify.design.next_experiment import propose_experiments
from discover.identify.side_by_side.many_laws import Contender

maxwell = Fluid.dimensionless(UpperConvectedMaxwell())
covariance = np.array(model.uncertainty_.covariance)
laws = [Contender("slip", found, covariance=covariance)]
laws += [Contender("twin", LawTerms({"tr(sigma)*gammadot": 0.32}), covariance=covariance)]
experiments = candidate_experiments(1.0, ("laos", "start_up"), (1.0, 2.0), (0.5, 1.0))
proposals = propose_experiments(laws[0], laws[1:], maxwell, experiments, noise=0.02)
best = proposals[0]
print(f"Measure {' and '.join(best.observed)} in {best.experiment.title}.")
print(f"Expected logarithm of the odds against the twin: {best.evidence['twin']:.0f}")
shear_alone = next(p for p in proposals if p.observed == ("sigma12",))
print(f"With σ12 alone: {shear_alone.evidence['twin']:.1g}")
table_of(proposals[:5])

# %%
truth = Fluid.dimensionless(make_law("johnson_segalman", {"xi": 0.4}))
stress = simulate(truth, best.experiment.protocol, best.experiment.times)
first = stress.first_normal_stress_difference
exact = {"sigma12": stress.shear_stress, "N2": stress.second_normal_stress_difference}
noise = {
    "sigma12": 0.02 * np.sqrt(np.mean(stress.shear_stress**2)),
    "N2": 0.02 * np.sqrt(np.mean(first**2)),
}
rng = np.random.default_rng(0)
measured = {q: exact[q] + noise[q] * rng.normal(size=exact[q].size) for q in best.observed}
table_of(judge_laws(laws, maxwell, best.experiment, measured, noise))

# %%
figure, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
for axis, quantity, column in zip(axes, ("sigma12", "N2"), (0, 2), strict=True):
    axis.plot(best.experiment.times, measured[quantity], ".", color="0.5", label="measured")
    for law, curve, style in zip(laws, best.curves, ("-", "--"), strict=True):
        axis.plot(best.experiment.times, curve[:, column], style, label=law.name)
    axis.set(xlabel="t / λ", ylabel=quantity)
axes[0].legend()
plt.show()

# %% [markdown]
# σ12 agrees for both laws. N2 tells them apart at a glance, so that is what has to be measured.
